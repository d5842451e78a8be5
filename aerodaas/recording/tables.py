"""Export of one channel as a table: CSV, or Parquet if pyarrow is installed."""

from __future__ import annotations

import csv
import difflib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from google.protobuf.message import Message

from aerodaas.clock import seconds
from aerodaas.errors import RecordingError
from aerodaas.recording.decoding.messages import BrokenMessageError, plain_fields
from aerodaas.recording.new_file import file_name, harmless, new_file
from aerodaas.recording.reader import Recording

__all__ = ["table_of", "write_csv", "write_parquet"]

Row = dict[str, Any]
_SPARSE = 16
"""Cells of a table for each one that holds anything; ours have hardly more than one."""
_FEW = 1_000_000
"""Cells that any table may have beyond that."""


def table_of(recording: Recording, topic: str) -> list[Row]:
    """All messages of a channel as flat rows with the same columns.

    `recorded_s` and `captured_s` are mission seconds, `sequence` is the message's number; names
    of nested fields are joined by dots, lists become JSON, bytes their length.

    Args:
        recording: An open recording.
        topic: Topic of the channel; the leading slash may be omitted.

    Returns:
        One dictionary per message, in the order of recording; missing fields are None.

    Raises:
        RecordingError: If the channel or its encoding is unknown, or hardly two messages have the
            same fields.
    """
    name = _known(recording, topic)
    rows = []
    for record in recording.records(topics=[name], as_json=True):
        row: Row = {
            "recorded_s": seconds(record.stamp),
            "captured_s": seconds(record.captured),
            "sequence": record.sequence,
        }
        value = record.value
        if isinstance(value, Message):
            try:
                value = plain_fields(value)
            except BrokenMessageError:
                recording.skipped[name] += 1
                continue
        if not isinstance(value, Mapping):
            encoding = recording.topics[name].encoding or "no known encoding"
            raise RecordingError(f"the messages of {name} are in {encoding}, not in rows")
        _flatten(value, "", row)
        rows.append(row)
    columns = dict.fromkeys(key for row in rows for key in row)
    if len(rows) * len(columns) > _SPARSE * sum(map(len, rows)) + _FEW:
        raise RecordingError(
            f"the messages of {name} have {len(columns)} different fields, hardly two the same: "
            "they make no table"
        )
    return [{column: row.get(column) for column in columns} for row in rows]


def write_csv(recording: Recording, topic: str, folder: Path) -> Path:
    """Write a channel as CSV; spreadsheets do not take its texts for formulas.

    Args:
        recording: An open recording.
        topic: Topic of the channel; the leading slash may be omitted.
        folder: Folder of the new file, created if necessary.

    Returns:
        The file.

    Raises:
        RecordingError: As in `table_of`; also if the file exists or cannot be written.
    """
    rows = table_of(recording, topic)
    path = new_file(folder / f"{file_name(topic)}.csv")
    try:
        with path.open("x", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(map(harmless, rows[0] if rows else ()))
            writer.writerows(map(harmless, row.values()) for row in rows)
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror}") from None
    return path


def write_parquet(recording: Recording, topic: str, folder: Path) -> Path:
    """Write a channel as Parquet.

    Args:
        recording: An open recording.
        topic: Topic of the channel; the leading slash may be omitted.
        folder: Folder of the new file, created if necessary.

    Returns:
        The file.

    Raises:
        RecordingError: As in `table_of`; also if pyarrow is missing, or the file exists or
            cannot be written.
    """
    try:
        import pyarrow as pa  # noqa: PLC0415 - an extra
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError:
        raise RecordingError(
            'Parquet needs pyarrow: pip install "aerodaas[parquet]", or use --csv'
        ) from None
    rows = table_of(recording, topic)
    path = new_file(folder / f"{file_name(topic)}.parquet")
    columns = {}
    for name in rows[0] if rows else []:
        values = [row[name] for row in rows]
        try:
            columns[name] = pa.array(values)
        except (pa.ArrowInvalid, pa.ArrowTypeError):
            # A field that holds numbers in one message and text in another.
            columns[name] = pa.array([None if value is None else str(value) for value in values])
    try:
        parquet.write_table(pa.table(columns), path)
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error}") from None
    return path


def _known(recording: Recording, topic: str) -> str:
    topics = recording.topics
    for name in (topic, f"/{topic}"):
        if name in topics:
            return name
    near = difflib.get_close_matches(topic, topics, n=3, cutoff=0.5)
    known = ", ".join(near or sorted(topics)) or "none"
    raise RecordingError(f"{recording.path} has no channel {topic!r}; it has: {known}")


def _flatten(value: Mapping[str, Any], prefix: str, row: Row) -> None:
    for key, item in value.items():
        name = f"{prefix}{key}"
        if isinstance(item, Mapping):
            _flatten(item, f"{name}.", row)
        elif isinstance(item, list | tuple):
            row[name] = json.dumps(item)
        else:
            row[name] = item
