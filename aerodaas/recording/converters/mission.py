"""Converters of mission states, navigation, decisions, alerts, log lines and vitals."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from foxglove.messages import Log, LogLevel

from aerodaas.clock import seconds
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.envelope import Message
from aerodaas.messages.mission import MissionPlan, MissionStatus
from aerodaas.messages.readings import Alert
from aerodaas.messages.vitals import Vitals
from aerodaas.messages.waypoints import Waypoint
from aerodaas.recording.converters.base import Session, convert, foxglove_entry, robot_of
from aerodaas.recording.converters.plan import plan_entries
from aerodaas.recording.encoding import Entry, plain
from aerodaas.recording.messages import NavigationRecord, json_entry

__all__ = ["log_entry"]


def log_entry(session: Session, stamp: int, level: LogLevel, name: str, text: str) -> Entry:
    """One line of the recording's log.

    Args:
        session: State of the recording.
        stamp: Mission time, nanoseconds.
        level: Level of the line.
        name: Its source.
        text: Its text.
    """
    line = Log(timestamp=session.time(stamp), level=level, message=text, name=name)
    return foxglove_entry("/log", line, stamp)


@convert.register
def _alert(item: Alert, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write an alert to the log and, with its figures, as JSON."""
    stamp = item.header.stamp
    yield log_entry(session, stamp, LogLevel.Warning, message.stream, f"{item.kind}: {item.text}")
    # An application's own figures may be of any class.
    known = replace(item, values=plain(item.values))
    yield json_entry(known, "", stamp, stream=message.stream)


@convert.register
def _text(item: str, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write a plain text as a line of the log."""
    yield log_entry(session, message.stamp, LogLevel.Info, message.stream, item)


@convert.register
def _log_record(
    item: logging.LogRecord, message: Message[Any], session: Session
) -> Iterator[Entry]:
    """Write a record of Python's logging, with its level, file and line."""
    line = Log(
        timestamp=session.time(message.stamp),
        level=_level(item.levelno),
        message=item.getMessage(),
        name=item.name,
        file=item.filename,
        line=item.lineno,
    )
    yield foxglove_entry("/log", line, message.header.stamp)


def _level(number: int) -> LogLevel:
    for least, level in (
        (logging.CRITICAL, LogLevel.Fatal),
        (logging.ERROR, LogLevel.Error),
        (logging.WARNING, LogLevel.Warning),
        (logging.INFO, LogLevel.Info),
    ):
        if number >= least:
            return level
    return LogLevel.Debug


@convert.register
def _mission_status(
    item: MissionStatus, message: Message[Any], session: Session
) -> Iterator[Entry]:
    """Write a status, a new plan, and log lines for a changed state and changed faults."""
    stream, robot = message.stream, robot_of(message)
    yield json_entry(item, stream, item.stamp, robot=robot, ahead=len(item.pending))
    if session.changed("state", stream, item.state):
        text = f"{item.state.value}: {item.reason}" if item.reason else item.state.value
        yield log_entry(session, item.stamp, LogLevel.Info, f"{robot} mission", text)
    if session.changed("faults", stream, item.faults):
        for fault in item.faults:
            yield log_entry(session, item.stamp, LogLevel.Warning, f"{robot} safety", fault)
    if _is_new_plan(item.ahead, stream, session):
        yield from plan_entries(MissionPlan(item.stamp, item.ahead), robot, stream, session)


def _is_new_plan(ahead: tuple[Waypoint, ...], stream: str, session: Session) -> bool:
    """Whether the plan has changed other than by reaching its first waypoints."""
    last: tuple[Waypoint, ...] = session.last.get(("plan", stream), ())
    if ahead == last[len(last) - len(ahead) :]:
        return False
    session.last["plan", stream] = ahead
    return True


@convert.register
def _navigation(item: AeroNavigation, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write the waypoints and commands of a navigation result."""
    del session
    yield json_entry(NavigationRecord.of(item, message.header), message.stream)


@convert.register
def _vitals(item: Vitals, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write a reading, with the number of cores in use since the last one."""
    actor, _, machine = message.header.source.partition("@")
    key = ("vitals", actor)
    before: Vitals | None = session.last.get(key)
    session.last[key] = item
    took = seconds(item.taken - before.taken) if before else 0.0
    used = item.cpu_seconds - before.cpu_seconds if before else 0.0
    # The counter of a restarted actor starts from zero.
    cores = used / took if took > 0 and used >= 0 else None
    labels = {"stamp": message.stamp, "actor": actor, "machine": machine, "cpu_cores": cores}
    entry = json_entry(item, message.stream, message.stamp, **labels)
    yield entry._replace(topic=f"/{message.stream}")
