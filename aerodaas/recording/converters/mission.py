"""Converters of mission states, plans, navigation and scheduler decisions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from foxglove.messages import LogLevel

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.envelope import Message
from aerodaas.messages.mission import Decision, MissionStatus
from aerodaas.messages.waypoints import Waypoint
from aerodaas.recording.converters.base import Session, convert
from aerodaas.recording.converters.notes import log_entry
from aerodaas.recording.converters.plan import plan_entries
from aerodaas.recording.encoding import Entry, json_bytes, json_schema, topic

__all__: list[str] = []

MISSION = json_schema(
    "MissionStatus",
    stamp="integer",
    robot="string",
    state="string",
    reason="string",
    target={},
    pending="integer",
    visited="array",
    visits="integer",
    given_up="array",
    distance="number",
    progress="number",
    faults="array",
    outlook={},
    photos="array",
    pilot="string",
    unfinished="string",
)
NAVIGATION = json_schema(
    "Navigation",
    stamp="integer",
    source="string",
    type="string",
    scheduling="string",
    priority={},
    waypoints="array",
    commands="array",
)
DECISION = json_schema(
    "Decision",
    stamp="integer",
    task="string",
    action="string",
    reason="string",
    values={"type": "object", "additionalProperties": {"type": "number"}},
)


@convert.register
def mission_status(item: MissionStatus, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write a status, a new plan, and log lines for a changed state and changed faults."""
    stream = message.stream
    robot = (message.header.source or stream).partition("/")[0]
    value = {
        "stamp": item.stamp,
        "robot": robot,
        "state": item.state.value,
        "reason": item.reason,
        "target": item.target,
        "pending": len(item.pending),
        "visited": item.visited,
        "visits": item.visits,
        "given_up": item.given_up,
        "distance": float(item.distance),
        "progress": item.progress,
        "faults": item.faults,
        "outlook": item.outlook,
        "photos": item.photos,
        "pilot": item.pilot,
        "unfinished": item.unfinished,
    }
    yield Entry(topic(stream, "mission"), MISSION, json_bytes(value), item.stamp)
    if session.changed("state", stream, item.state):
        text = f"{item.state.value}: {item.reason}" if item.reason else item.state.value
        yield log_entry(session, item.stamp, LogLevel.Info, f"{robot} mission", text)
    if session.changed("faults", stream, item.faults):
        for fault in item.faults:
            yield log_entry(session, item.stamp, LogLevel.Warning, f"{robot} safety", fault)
    ahead = ((item.target,) if item.target is not None else ()) + item.pending
    if _is_new_plan(ahead, stream, session):
        yield from plan_entries(ahead, robot, stream, item.stamp, session)


def _is_new_plan(ahead: tuple[Waypoint, ...], stream: str, session: Session) -> bool:
    """Whether the plan has changed other than by reaching its first waypoints."""
    last: tuple[Waypoint, ...] = session.last.get(("plan", stream), ())
    if ahead == last[len(last) - len(ahead) :]:
        return False
    session.last["plan", stream] = ahead
    return True


@convert.register
def navigation(item: AeroNavigation, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write the waypoints and commands of a navigation result."""
    del session
    header = message.header
    value = {
        "stamp": header.stamp,
        "source": header.source,
        "type": item.navigation_type.value,
        "scheduling": item.scheduling_type.value,
        "priority": item.priority,
        "waypoints": item.waypoints,
        "commands": item.commands,
    }
    yield Entry(topic(message.stream, "navigation"), NAVIGATION, json_bytes(value))


@convert.register
def decision(item: Decision, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write a scheduler decision with its reason."""
    del session
    value = {
        "stamp": item.stamp,
        "task": item.task,
        "action": item.action,
        "reason": item.reason,
        "values": item.values,
    }
    yield Entry(topic(message.stream, "decision"), DECISION, json_bytes(value), item.stamp)
