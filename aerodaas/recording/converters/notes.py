"""Converters of alerts and log lines."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from foxglove.messages import Log, LogLevel

from aerodaas.messages.envelope import Message
from aerodaas.messages.readings import Alert
from aerodaas.recording.converters.base import Session, convert
from aerodaas.recording.encoding import Entry, plain
from aerodaas.recording.messages import json_entry

__all__ = ["log_entry"]

LOG = Log.get_schema()


def log_entry(session: Session, stamp: int, level: LogLevel, name: str, text: str) -> Entry:
    """One line of the recording's log, with `name` as its source."""
    line = Log(timestamp=session.time(stamp), level=level, message=text, name=name)
    return Entry("/log", LOG, line.encode(), stamp)


@convert.register
def alert(item: Alert, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write an alert to the log and, with its figures, as JSON."""
    stamp = item.header.stamp
    yield log_entry(session, stamp, LogLevel.Warning, message.stream, f"{item.kind}: {item.text}")
    # An application's own figures may be of any class.
    known = replace(item, values=plain(item.values))
    yield json_entry(known, "", stamp, stream=message.stream)


@convert.register
def text(item: str, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write a plain text as a line of the log."""
    yield log_entry(session, message.stamp, LogLevel.Info, message.stream, item)


@convert.register
def log_record(item: logging.LogRecord, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write a record of Python's logging, with its level, file and line."""
    line = Log(
        timestamp=session.time(message.stamp),
        level=_level(item.levelno),
        message=item.getMessage(),
        name=item.name,
        file=item.filename,
        line=item.lineno,
    )
    yield Entry("/log", LOG, line.encode())


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
