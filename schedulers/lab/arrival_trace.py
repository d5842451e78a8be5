"""Workloads whose arrivals are measured: a CSV of times, or invocations per minute.

- A CSV with the column `seconds`, or a single column without a heading: when each segment of video
  comes, ascending. Beside it there may be `source` and `edge`, and `model`, with which a row is one
  task of that model instead of a segment with a task for each.
- Azure Functions' invocations per minute (`HashOwner`, `HashApp`, `HashFunction`, `Trigger`, `1` to
  `1440`; Shahrad et al., USENIX ATC 2020): each function is a source, each invocation a segment, at
  a time within its minute that the seed decides. `FILE@HASH` takes functions whose hash begins so.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import Profile
from aerodaas.schedulers.analytics.published.profiles import ACTIVE, PUBLISHED
from aerodaas.schedulers.lab.trace_errors import bad_line
from aerodaas.schedulers.lab.workload import Segments, TaskArrival, Workload

__all__ = ["TRACE", "read_arrivals"]

TRACE = "trace:"
"""What the name of such a workload begins with."""

_MOST = 200_000
"""Segments or tasks."""
_MOST_SECONDS = 400 * 24 * 3600
_MOST_EDGES = 10_000
_MINUTE = 60 * NANOSECONDS

_Row = tuple[int, list[str]]
"""Number of the line, its cells."""


def read_arrivals(
    wanted: str, duration: int | None = None, models: Mapping[str, Profile] | None = None
) -> Workload:
    """Make a workload of a trace.

    Args:
        wanted: The file; for Azure's, `FILE@HASH` chooses functions.
        duration: Nanoseconds that are read; None for all.
        models: What a segment makes a task for each of; by default the six published ones.

    Raises:
        SchedulerError: With the file and the line, for what is no such trace; or for more than
            200 000 arrivals.
    """
    name, at_sign, function = wanted.rpartition("@")
    path = Path(name if at_sign and not Path(wanted).exists() else wanted)
    function = function if str(path) == name else ""
    models = models or {one: PUBLISHED[one] for one in ACTIVE}
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = _rows(path, csv.reader(file, strict=True))
            number, first = next(rows, (0, []))
            if not first:
                raise SchedulerError(f"{path}: there is nothing in it")
            heading = [cell.strip() for cell in first]
            if "HashFunction" in heading:
                return _invocations(path, heading, rows, function, duration, models)
            if function:
                raise SchedulerError(
                    f"{path}: @{function} chooses Azure's functions; there are none"
                )
            if "seconds" not in heading:
                if len(heading) > 1:
                    raise bad_line(path, number, "there is no column `seconds`")
                rows, heading = _before((number, first), rows), ["seconds"]
            return _times(path, heading, rows, duration, models)
    except OSError as error:
        raise SchedulerError(f"cannot read the trace {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SchedulerError(f"{path}: a trace is text, which this is not") from None


def _times(
    path: Path,
    heading: list[str],
    rows: Iterator[_Row],
    duration: int | None,
    models: Mapping[str, Profile],
) -> Workload:
    arrivals: list[TaskArrival] = []
    segments: list[Segments] = []
    before = last_edge = 0
    for number, cells in rows:
        if len(cells) != len(heading):
            raise bad_line(path, number, f"{len(cells)} columns, the first line has {len(heading)}")
        row = dict(zip(heading, (cell.strip() for cell in cells), strict=True))
        at = _stamp(path, number, row["seconds"])
        if at < before:
            raise bad_line(path, number, "seconds must not descend")
        before = at
        edge = _whole(path, number, row.get("edge") or "0", _MOST_EDGES)
        if duration is not None and at >= duration:
            continue
        last_edge = max(last_edge, edge)
        if "model" not in row:
            segments.append(Segments(at, source=row.get("source", ""), edge=edge))
        elif row["model"] in models:
            arrivals.append(TaskArrival(at, row["model"], row.get("source", ""), edge))
        else:
            raise bad_line(path, number, f"no model {row['model'][:40]!r}: {', '.join(models)}")
        _few_enough(path, len(segments) + len(arrivals))
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


def _invocations(
    path: Path,
    heading: list[str],
    rows: Iterator[_Row],
    function: str,
    duration: int | None,
    models: Mapping[str, Profile],
) -> Workload:
    name = heading.index("HashFunction")
    minutes = [place for place, title in enumerate(heading) if title.isascii() and title.isdigit()]
    if [heading[place] for place in minutes] != [str(one + 1) for one in range(len(minutes))]:
        raise bad_line(path, 1, "minutes must be the columns 1, 2, 3 and so on")
    read = minutes if duration is None else minutes[: -(-duration // _MINUTE)]
    segments: list[Segments] = []
    total = 0
    for number, cells in rows:
        if len(cells) != len(heading):
            raise bad_line(path, number, f"{len(cells)} columns, the first line has {len(heading)}")
        if not cells[name].startswith(function):
            continue
        for minute, place in enumerate(read):
            count = _whole(path, number, cells[place].strip(), _MOST_SECONDS)
            if count:
                total += count
                _few_enough(path, total)
                source = cells[name][:12]
                segments.append(Segments(minute * _MINUTE, _MINUTE, count, source))
    if not segments:
        raise SchedulerError(f"{path}: no invocation of {function or 'any function'} is in the run")
    return Workload(
        f"{TRACE}{path.name}{'@' if function else ''}{function}",
        models,
        duration=duration or len(minutes) * _MINUTE,
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


def _before(first: _Row, rows: Iterator[_Row]) -> Iterator[_Row]:
    yield first
    yield from rows


def _stamp(path: Path, number: int, text: str) -> int:
    try:
        seconds = float(text)
    except ValueError:
        raise bad_line(path, number, f"{text[:40]!r} is no number of seconds") from None
    if not 0 <= seconds <= _MOST_SECONDS or math.isnan(seconds):
        raise bad_line(path, number, f"{text[:40]!r} is no time from 0 s to 400 days")
    return round(seconds * NANOSECONDS)


def _whole(path: Path, number: int, text: str, most: int) -> int:
    plain = text.isascii() and text.isdigit() and len(text) <= len(str(most))
    if not plain or int(text) > most:
        raise bad_line(path, number, f"{text[:40]!r} is no whole number from 0 to {most}")
    return int(text)


def _few_enough(path: Path, count: int) -> None:
    if count > _MOST:
        raise SchedulerError(
            f"{path}: more than {_MOST:,} arrivals; take a shorter --duration, or fewer of Azure's "
            "functions: FILE@HASH"
        )
