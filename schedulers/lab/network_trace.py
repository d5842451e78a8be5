"""Measured bandwidth from a file.

Which format it is shows in the first line:

- one whole number: Mahimahi, a millisecond at which 1500 bytes may go, one to a line;
- two numbers: seconds and Mbit/s, as Pensieve cooks FCC's and others' measurements; a line's rate
  was measured up to its time;
- a CSV: seconds and Mbit/s of one's own; a rate lasts until the next line's.

Measured traces begin anew when they are over, as Mahimahi and Pensieve play them; in a CSV of one's
own the last rate stays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import MILLISECOND

__all__ = ["bad_line", "read_bandwidth"]

_MOST_BYTES = 64 * 2**20
_MOST_STEPS = 1_000_000
_MBIT = 125_000
"""Bytes per second of 1 Mbit/s."""
_PACKET = 1500
"""Bytes of one opportunity, whatever is sent (mm-link(1))."""
_BIN = 100
"""Milliseconds over which packets are counted."""
_BEYOND = 60 * NANOSECONDS
"""After the end of a run, so that what began in it ends by the trace, too."""
_LONGEST = 400 * 24 * 3600.0
"""Seconds of a trace, beyond which a number is none of seconds."""

_Step = tuple[int, float]
"""Nanoseconds that it lasts, bytes per second."""
_Row = tuple[int, list[str]]
"""Number of the line, its words."""


def bad_line(path: Path, number: int, what: str) -> SchedulerError:
    """The error that says `what` is wrong in a line of a trace.

    Args:
        path: The file.
        number: Number of the line, from 1.
        what: The mistake.
    """
    return SchedulerError(f"{path}, line {number}: {what}")


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
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines:
        raise SchedulerError(f"{path}: there is nothing in it")
    if "," in lines[0][1]:
        return _own(path, [(number, line.split(",")) for number, line in lines])
    rows = [(number, line.split()) for number, line in lines]
    columns = len(rows[0][1])
    for number, words in rows:
        if len(words) != columns:
            raise bad_line(
                path, number, f"{len(words)} columns, where the first line has {columns}"
            )
    readers = {1: _mahimahi, 2: _cooked}
    if columns not in readers:
        raise SchedulerError(
            f"{path}: a bandwidth trace has one column (Mahimahi), two (seconds, Mbit/s) or is a "
            f"CSV of seconds, Mbit/s; not {columns} columns"
        )
    return _repeated(path, readers[columns](path, rows), duration)


def _own(path: Path, rows: Sequence[_Row]) -> tuple[tuple[int, float], ...]:
    points: list[tuple[int, float]] = []
    for number, words in rows[0 if _is_number(rows[0][1][0]) else 1 :]:
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


def _mahimahi(path: Path, rows: Sequence[_Row]) -> list[_Step]:
    stamps: list[int] = []
    for number, (word,) in rows:
        if not (word.isascii() and word.isdigit()) or len(word) > 15:  # noqa: PLR2004 - exact as a float, too
            raise bad_line(path, number, f"{word[:40]!r} is no whole number of up to 15 digits")
        if stamps and int(word) < stamps[-1]:
            raise bad_line(path, number, "milliseconds must not descend")
        stamps.append(int(word))
    period = stamps[-1]
    if period == 0:
        raise SchedulerError(f"{path}: all packets are at 0 ms, which spans no time")
    bins = -(-period // _BIN)
    if bins > _MOST_STEPS:
        raise bad_line(path, rows[-1][0], "the trace is longer than a day")
    packets = [0] * bins
    for stamp in stamps:
        packets[max(stamp - 1, 0) // _BIN] += 1
    lengths = [_BIN] * (bins - 1) + [period - _BIN * (bins - 1)]
    return [
        (length * MILLISECOND, count * _PACKET * 1000 / length)
        for count, length in zip(packets, lengths, strict=True)
    ]


def _cooked(path: Path, rows: Sequence[_Row]) -> list[_Step]:
    steps: list[_Step] = []
    before: float | None = None
    for number, words in rows:
        at = _number(path, number, words[0], math.inf)
        rate = _number(path, number, words[1]) * _MBIT
        if before is not None:
            length = int((at - before) * NANOSECONDS) if 0 < at - before < _LONGEST else 0
            if length <= 0:
                raise bad_line(path, number, "times must ascend, by 400 days at most")
            steps.append((length, rate))
        before = at
    return steps


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
