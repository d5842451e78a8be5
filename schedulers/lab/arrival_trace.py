"""Workloads whose arrivals are measured: a CSV of times.

It has the column `seconds`, or a single column without a heading: when each segment of video comes,
ascending. Beside it there may be `source` and `edge`, and `model`, with which a row is one task of
that model instead of a segment with a task for each.
"""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import Profile
from aerodaas.schedulers.analytics.published.profiles import ACTIVE, PUBLISHED
from aerodaas.schedulers.lab.network_trace import bad_line
from aerodaas.schedulers.lab.workload import Segment, TaskArrival, Workload

__all__ = ["TRACE", "read_arrivals"]

TRACE = "trace:"
"""What the name of such a workload begins with."""

_MOST = 200_000
"""Segments or tasks."""
_MOST_SECONDS = 400 * 24 * 3600
_MOST_EDGES = 10_000

_Row = tuple[int, list[str]]
"""Number of the line, its cells."""


def read_arrivals(
    path: str | Path, duration: int | None = None, models: Mapping[str, Profile] | None = None
) -> Workload:
    """Make a workload of a trace.

    Args:
        path: The file.
        duration: Nanoseconds that are read; None for all.
        models: What a segment makes a task for each of; by default the six published ones.

    Raises:
        SchedulerError: With the file and the line, for what is no such trace; or for more than
            200 000 arrivals.
    """
    path = Path(path)
    models = models or {one: PUBLISHED[one] for one in ACTIVE}
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = _rows(path, csv.reader(file, strict=True))
            number, first = next(rows, (0, []))
            if not first:
                raise SchedulerError(f"{path}: there is nothing in it")
            heading = [cell.strip() for cell in first]
            if "seconds" not in heading:
                if len(heading) > 1:
                    raise bad_line(path, number, "there is no column `seconds`")
                rows, heading = itertools.chain([(number, first)], rows), ["seconds"]
            return _workload(path, heading, rows, duration, models)
    except OSError as error:
        raise SchedulerError(f"cannot read the trace {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SchedulerError(f"{path}: a trace is text, which this is not") from None


def _workload(
    path: Path,
    heading: list[str],
    rows: Iterator[_Row],
    duration: int | None,
    models: Mapping[str, Profile],
) -> Workload:
    arrivals: list[TaskArrival] = []
    segments: list[Segment] = []
    before = last_edge = 0
    for number, cells in rows:
        if len(cells) != len(heading):
            raise bad_line(path, number, f"{len(cells)} columns, the first line has {len(heading)}")
        row = dict(zip(heading, (cell.strip() for cell in cells), strict=True))
        at = _stamp(path, number, row["seconds"])
        if at < before:
            raise bad_line(path, number, "seconds must not descend")
        before = at
        edge = _edge(path, number, row.get("edge") or "0")
        if duration is not None and at >= duration:
            continue
        last_edge = max(last_edge, edge)
        if "model" not in row:
            segments.append(Segment(at, row.get("source", ""), edge))
        elif row["model"] in models:
            arrivals.append(TaskArrival(at, row["model"], row.get("source", ""), edge))
        else:
            raise bad_line(path, number, f"no model {row['model'][:40]!r}: {', '.join(models)}")
        if len(segments) + len(arrivals) > _MOST:
            raise SchedulerError(f"{path}: more than {_MOST:,} arrivals; take a shorter --duration")
    if not segments and not arrivals:
        raise SchedulerError(f"{path}: no time of it is in the run")
    # To the next whole second, so that the last one belongs to it.
    lasts = duration or (before // NANOSECONDS + 1) * NANOSECONDS
    return Workload(
        f"{TRACE}{path.name}",
        models,
        edges=last_edge + 1,
        duration=lasts,
        arrivals=tuple(arrivals),
        segments=tuple(segments),
    )


def _rows(path: Path, reader: Iterator[list[str]]) -> Iterator[_Row]:
    number = 0
    try:
        for number, cells in enumerate(reader, 1):
            if cells:
                yield number, cells
    except csv.Error as error:
        raise bad_line(path, number + 1, str(error)) from None


def _stamp(path: Path, number: int, text: str) -> int:
    try:
        seconds = float(text)
    except ValueError:
        raise bad_line(path, number, f"{text[:40]!r} is no number of seconds") from None
    if not 0 <= seconds <= _MOST_SECONDS or math.isnan(seconds):
        raise bad_line(path, number, f"{text[:40]!r} is no time from 0 s to 400 days")
    return round(seconds * NANOSECONDS)


def _edge(path: Path, number: int, text: str) -> int:
    plain = text.isascii() and text.isdigit() and len(text) <= len(str(_MOST_EDGES))
    if not plain or int(text) > _MOST_EDGES:
        raise bad_line(path, number, f"{text[:40]!r} is no whole number from 0 to {_MOST_EDGES}")
    return int(text)
