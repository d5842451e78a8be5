"""Streams and recorded channels as pandas tables."""

from __future__ import annotations

import dataclasses
import enum
import itertools
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerodaas.clock import seconds as to_seconds
from aerodaas.config.extras import require_extra
from aerodaas.dataflow.graph import AeroStreamData
from aerodaas.errors import MissionError
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Frame, Header
from aerodaas.recording.pictures import DETECTIONS_SCHEMA, detections
from aerodaas.recording.reader import Recording
from aerodaas.recording.tables import table_of

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["live_table", "recorded_table"]

_TIME = "seconds"
"""Name of the index: mission seconds of capture."""
_AXES = ("east", "north", "up")
Row = dict[str, Any]


def live_table(
    stream: AeroStreamData[Any], *, items: int | None = None, seconds: float = 5.0
) -> DataFrame:
    """Table of a stream's items from now on, in flight.

    Numbers, texts and states become columns, vectors three of them (`position_east`, …), detections
    a row each; a frame's pixels are left out.

    Args:
        stream: Of a sensor or an analysis.
        items: Return after so many items; None: as many as come.
        seconds: Return after so many wall seconds at the latest.

    Returns:
        A row for each item, by mission seconds of capture; it ends with the mission.

    Raises:
        ConfigError: Without pandas.
        GraphError: Before the mission has started.
        MissionError: If a provider flies it, who sends no times; its recording has them.
    """
    require_extra("notebook", "a table")
    reader = stream.open_reader()
    next_message = getattr(reader, "next_message", None)
    if next_message is None:
        raise MissionError(
            f"{stream.name} comes from a provider, without times: make a table of the recording"
        )
    rows: list[Row] = []
    until = time.monotonic() + seconds
    for _ in itertools.count() if items is None else range(items):
        if (left := until - time.monotonic()) <= 0:
            break
        try:
            message = next_message(left)
        except (TimeoutError, StopIteration):
            break
        rows += ({_TIME: to_seconds(message.header.stamp), **row} for row in _rows(message.item))
    return _frame(rows)


def recorded_table(recording: str | Path, what: str | AeroStreamData[Any]) -> DataFrame:
    """Table of a recorded stream, or of a channel.

    Detections are a row each, as in flight. Of other messages nested fields are joined by dots, and
    lists are JSON.

    Args:
        recording: The MCAP file, such as `env.run.recording`.
        what: A stream of the application that flew, its name such as `drone/odometry`, or a
            channel such as `/drone/state/odometry`; `aerodaas export topics FILE` lists them.

    Returns:
        A row for each message, by mission seconds of capture.

    Raises:
        ConfigError: Without pandas.
        RecordingError: If the file cannot be read, or has no such channel.
    """
    require_extra("notebook", "a table")
    name = what if isinstance(what, str) else what.name
    with Recording.open(recording) as opened:
        topic = _channel(opened, name)
        if topic in opened.topics and opened.topics[topic].schema == DETECTIONS_SCHEMA:
            found = (one for channel, one in detections(opened) if channel == topic)
            rows = [
                {_TIME: to_seconds(one.header.stamp), **row} for one in found for row in _rows(one)
            ]
        else:
            rows = [{_TIME: row.pop("captured_s"), **row} for row in table_of(opened, topic)]
    return _frame(rows)


def _channel(recording: Recording, name: str) -> str:
    """The channel of a stream, whose messages may have one beneath its name; else the name."""
    topic = f"/{name.removeprefix('/')}"
    beneath = [
        one.name
        for one in recording.topics.values()
        if one.name.startswith(f"{topic}/") and one.schema.startswith("aerodaas.")
    ]
    return beneath[0] if topic not in recording.topics and len(beneath) == 1 else topic


def _frame(rows: list[Row]) -> DataFrame:
    import pandas as pd  # noqa: PLC0415 - an extra

    if not rows:
        return pd.DataFrame(index=pd.Index([], name=_TIME, dtype=float))
    return pd.DataFrame(rows).set_index(_TIME)


def _rows(item: object) -> Iterator[Row]:
    """An item's rows: one, but of detections one for each."""
    if not isinstance(item, Detections):
        yield dict(_cells("", item)) or {"value": item}
        return
    for one in item:
        edges = dict(zip(("left", "top", "right", "bottom"), one.box, strict=True))
        rest = {"label": one.label, "score": one.score, "track_id": one.track_id}
        yield {"frame": item.header.id, **rest, **edges, "depth": one.depth}


def _cells(prefix: str, item: object) -> Iterator[tuple[str, Any]]:
    """Names and values of what fits into cells."""
    fields: dict[str, Any] = {}
    if isinstance(item, Header):
        # The stamp is the index.
        fields = {"id": item.id, "source": item.source}
    elif isinstance(item, Frame):
        fields = {"width": item.width, "height": item.height, "header": item.header}
    elif dataclasses.is_dataclass(item):
        fields = {one.name: getattr(item, one.name) for one in dataclasses.fields(item)}
    elif isinstance(item, dict):
        fields = item
    for name, value in fields.items():
        whole = f"{prefix}{name}"
        if isinstance(value, np.ndarray) and value.shape == (len(_AXES),):
            yield from zip((f"{whole}_{axis}" for axis in _AXES), value.tolist(), strict=True)
        elif isinstance(value, enum.Enum):
            yield whole, value.value
        elif value is None or isinstance(value, bool | int | float | str):
            yield whole, value
        else:
            inner = "" if name in {"header", "values"} else f"{whole}_"
            yield from _cells(inner, value)
