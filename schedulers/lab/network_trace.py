"""Measured bandwidth from a file, in the formats of public traces.

Which format it is shows in the first line:

- one whole number: Mahimahi, a millisecond at which 1500 bytes may go, one to a line;
- two numbers: seconds and Mbit/s, as Pensieve cooks FCC's and others' measurements; a line's rate
  was measured up to its time;
- six numbers: Ghent's 4G/LTE logs (van der Hooft et al., 2016), whose last two columns are bytes
  and milliseconds since the line before;
- a CSV with the columns `Timestamp` and `DL_bitrate` (kbit/s): G-NetTrack's logs, as in the 4G and
  5G datasets of University College Cork (Raca et al., 2018 and 2020);
- any other CSV: seconds and Mbit/s of one's own; a rate lasts until the next line's.

Measured traces begin anew when they are over, as Mahimahi and Pensieve play them; in a CSV of one's
own the last rate stays.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from statistics import fmean

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import MILLISECOND
from aerodaas.schedulers.lab.trace_errors import bad_line

__all__ = ["read_bandwidth"]

_MOST_BYTES = 64 * 2**20
_MOST_STEPS = 1_000_000
_MBIT = 125_000
"""Bytes per second of 1 Mbit/s."""
_KBIT = 125
_PACKET = 1500
"""Bytes of one opportunity, whatever is sent (mm-link(1))."""
_BIN = 100
"""Milliseconds over which packets are counted."""
_BEYOND = 60 * NANOSECONDS
"""After the end of a run, so that what began in it ends by the trace, too."""
_LONGEST = 400 * 24 * 3600.0
"""Seconds of a trace, beyond which a number is none of seconds."""
_GHENT = 6
"""Columns."""

_Step = tuple[int, float]
"""Nanoseconds that it lasts, bytes per second."""
_Row = tuple[int, list[str]]
"""Number of the line, its words."""


def read_bandwidth(path: Path, duration: int) -> tuple[tuple[int, float], ...]:
    """Read a trace as a step function: begins in nanoseconds from 0, ascending; bytes per second.

    Args:
        path: A file of at most 64 MiB.
        duration: Nanoseconds that a run takes; a shorter measured trace is repeated.

    Raises:
        SchedulerError: With the file and the line, for what is no trace.
    """
    try:
        size = path.stat().st_size
        text = path.read_text(encoding="utf-8-sig") if size <= _MOST_BYTES else ""
    except OSError as error:
        raise SchedulerError(f"cannot read the bandwidth trace {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SchedulerError(f"{path}: a bandwidth trace is text, which this is not") from None
    if size > _MOST_BYTES:
        raise SchedulerError(f"{path}: a bandwidth trace has at most {_MOST_BYTES >> 20} MiB")
    first = next((line for line in text.splitlines() if line.strip()), "")
    if not first:
        raise SchedulerError(f"{path}: there is nothing in it")
    if "," in first:
        rows = _table(path, text)
        header = [word.strip() for word in rows[0][1]]
        if "DL_bitrate" in header and "Timestamp" in header:
            return _repeated(path, _gnettrack(path, header, rows[1:]), duration)
        return _own(path, rows)
    lines = [
        (number, line.split()) for number, line in enumerate(text.splitlines(), 1) if line.strip()
    ]
    columns = len(first.split())
    for number, words in lines:
        if len(words) != columns:
            raise bad_line(
                path, number, f"{len(words)} columns, where the first line has {columns}"
            )
    readers = {1: _mahimahi, 2: _cooked, _GHENT: _ghent}
    if columns not in readers:
        raise SchedulerError(
            f"{path}: a bandwidth trace has one column (Mahimahi), two (seconds, Mbit/s) or six "
            f"(Ghent's logs), or is a CSV; not {columns} columns"
        )
    return _repeated(path, readers[columns](path, lines), duration)


def _own(path: Path, rows: Sequence[_Row]) -> tuple[tuple[int, float], ...]:
    if not _is_number(rows[0][1][0]):
        rows = rows[1:]
    points: list[tuple[int, float]] = []
    for number, words in rows:
        if len(words) < 2:  # noqa: PLR2004 - seconds and Mbit/s
            raise bad_line(path, number, "each line holds seconds and Mbit/s")
        at = int(_number(path, number, words[0], _LONGEST) * NANOSECONDS)
        rate = _number(path, number, words[1]) * _MBIT
        if points and at <= points[-1][0]:
            raise bad_line(path, number, "seconds must ascend")
        if rate <= 0:
            raise bad_line(path, number, "each Mbit/s must be positive; `outage` is for no link")
        points.append((at, rate))
    if not points:
        raise SchedulerError(f"{path}: there is a heading and nothing else")
    return tuple(points)


def _mahimahi(path: Path, lines: Sequence[_Row]) -> list[_Step]:
    stamps = [_whole(path, number, words[0]) for number, words in lines]
    for place, (number, _) in enumerate(lines[1:], 1):
        if stamps[place] < stamps[place - 1]:
            raise bad_line(path, number, "milliseconds must not descend")
    period = stamps[-1]
    if period == 0:
        raise SchedulerError(f"{path}: all packets are at 0 ms, which spans no time")
    bins = -(-period // _BIN)
    if bins > _MOST_STEPS:
        raise bad_line(path, lines[-1][0], "the trace is longer than a day")
    packets = [0] * bins
    for stamp in stamps:
        packets[max(stamp - 1, 0) // _BIN] += 1
    lengths = [_BIN] * (bins - 1) + [period - _BIN * (bins - 1)]
    return [
        (length * MILLISECOND, count * _PACKET * 1000 / length)
        for count, length in zip(packets, lengths, strict=True)
    ]


def _cooked(path: Path, lines: Sequence[_Row]) -> list[_Step]:
    steps: list[_Step] = []
    before: float | None = None
    for number, words in lines:
        at = _number(path, number, words[0], math.inf)
        rate = _number(path, number, words[1]) * _MBIT
        if before is not None:
            steps.append((_lasting(path, number, at - before), rate))
        before = at
    return steps


def _ghent(path: Path, lines: Sequence[_Row]) -> list[_Step]:
    steps: list[_Step] = []
    before = -1
    for number, words in lines:
        at = _whole(path, number, words[1])
        for word in (words[0], words[2], words[3]):
            _number(path, number, word.removeprefix("-"), math.inf)
        size, taken = (_whole(path, number, word) for word in words[4:])
        if at <= before:
            raise bad_line(path, number, "milliseconds since the start must ascend")
        before = at
        if taken == 0 and size:
            raise bad_line(path, number, f"{size} bytes in no time")
        if taken:
            rate = _number(path, number, str(size * 1000 / taken))
            steps.append((_lasting(path, number, taken / 1000), rate))
    return steps


def _gnettrack(path: Path, header: Sequence[str], rows: Sequence[_Row]) -> list[_Step]:
    time, rate = header.index("Timestamp"), header.index("DL_bitrate")
    seconds: list[tuple[int, datetime, list[float]]] = []
    for number, words in rows:
        if len(words) <= max(time, rate):
            raise bad_line(
                path, number, f"{len(words)} columns, where the heading has {len(header)}"
            )
        try:
            at = datetime.strptime(words[time].strip(), "%Y.%m.%d_%H.%M.%S")  # noqa: DTZ007 - differences only
        except ValueError:
            raise bad_line(
                path, number, f"{words[time]!r} is no time 2020.01.31_23.59.59"
            ) from None
        value = _number(path, number, words[rate]) * _KBIT
        if seconds and at == seconds[-1][1]:
            # Of several rows within a second, which is as fine as stamps are, the mean.
            seconds[-1][2].append(value)
            continue
        if seconds and at < seconds[-1][1]:
            raise bad_line(path, number, "times must not descend")
        seconds.append((number, at, [value]))
    if not seconds:
        raise SchedulerError(f"{path}: there is a heading and nothing else")
    steps = [
        (_lasting(path, after[0], (after[1] - now[1]).total_seconds()), fmean(now[2]))
        for now, after in pairwise(seconds)
    ]
    return [*steps, (NANOSECONDS, fmean(seconds[-1][2]))]


def _repeated(path: Path, steps: Sequence[_Step], duration: int) -> tuple[tuple[int, float], ...]:
    """Steps one after the other, again and again until a run is over; equal ones joined."""
    if not steps:
        raise SchedulerError(f"{path}: a single line measures nothing; there must be two")
    if not any(rate for _, rate in steps):
        raise SchedulerError(f"{path}: no line has any bandwidth")
    points: list[tuple[int, float]] = []
    at = 0
    while at < duration + _BEYOND:
        for length, rate in steps:
            if not points or points[-1][1] != rate:
                points.append((at, rate))
            at += length
        if len(points) > _MOST_STEPS:
            raise SchedulerError(
                f"{path}: more than {_MOST_STEPS:,} changes of bandwidth; a shorter run has fewer"
            )
        if len(points) == 1:
            break
    return tuple(points)


def _table(path: Path, text: str) -> list[_Row]:
    def read() -> Iterator[_Row]:
        reader = csv.reader(text.splitlines())
        for words in reader:
            if words:
                yield reader.line_num, words

    try:
        return list(read())
    except csv.Error as error:
        raise SchedulerError(f"{path}: {error}") from None


def _lasting(path: Path, number: int, seconds: float) -> int:
    """A step's length in nanoseconds."""
    length = int(seconds * NANOSECONDS) if 0 < seconds < _LONGEST else 0
    if length <= 0:
        raise bad_line(path, number, "times must ascend, by 400 days at most")
    return length


def _whole(path: Path, number: int, text: str) -> int:
    if not (text.isascii() and text.isdigit()) or len(text) > 15:  # noqa: PLR2004 - exact as a float, too
        raise bad_line(path, number, f"{text[:40]!r} is no whole number of up to 15 digits")
    return int(text)


def _number(path: Path, number: int, text: str, most: float = 1e9) -> float:
    """A number from 0 to `most`, by default one of any bandwidth, and never infinite."""
    try:
        value = float(text)
    except ValueError:
        raise bad_line(path, number, f"{text[:40]!r} is no number") from None
    if not 0 <= value <= most or math.isinf(value):
        raise bad_line(path, number, f"{text[:40]!r} is no number from 0 to {most:g}")
    return value


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
