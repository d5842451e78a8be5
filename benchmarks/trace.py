"""Where the microseconds go between a frame's capture and the drone's command.

The four actors of `latency.py`, with stamps at each step of the three hops between them.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import tempfile
from bisect import bisect_left
from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import aerodaas.actors  # noqa: F401 - sets what Ray reads as it is imported

# isort: split
import _stamps
import ray
import typer
from _latency_ours import HEIGHT, RATE, WIDTH
from _report import Report
from latency import measure_ours

_STEPS = {
    "encode": ("encode", "encoded"),
    "look for readers, take a slot": ("encoded", "taken"),
    "write": ("taken", "written"),
    "send": ("written", "sent"),
    "written until the thread is awake": ("written", "awake"),
    "awake until the message is found": ("awake", "decode"),
    "decode": ("decode", "decoded"),
    "hand over to the work": ("decoded", "work"),
}
"""What a step is, and the stamps at its ends."""
_HOPS = ("camera to analysis", "analysis to navigation", "navigation to drone")
UNITS: dict[str, str] = dict.fromkeys(_HOPS, "us")
Stamps = dict[str, dict[str, dict[int, int]]]
"""Nanoseconds by stream, step, and number of the message."""


def _read(folder: Path) -> Stamps:
    stamps: Stamps = defaultdict(lambda: defaultdict(dict))
    for path in folder.glob("*.stamps"):
        for step, stream, number, when in json.loads(path.read_text(encoding="utf-8")):
            stamps[stream][step][number] = when
    return stamps


def _median(pairs: list[tuple[int, int]]) -> float:
    return statistics.median((end - begin) / 1000 for begin, end in pairs) if pairs else math.nan


def _between(begins: dict[int, int], ends: dict[int, int]) -> float:
    return _median([(when, ends[number]) for number, when in begins.items() if number in ends])


def _until_next(begins: dict[int, int], ends: dict[int, int]) -> float:
    """From each begin to the first end after it: the work, whose result has another number."""
    ordered = sorted(ends.values())
    places = ((when, bisect_left(ordered, when)) for when in begins.values())
    return _median([(when, ordered[place]) for when, place in places if place < len(ordered)])


def main(
    seconds: Annotated[float, typer.Option(min=2, help="Seconds measured.")] = 20.0,
    json_path: Annotated[Path | None, typer.Option("--json", help="Write the figures.")] = None,
) -> None:
    """Stamp each frame at each step and show the medians in microseconds.

    python benchmarks/trace.py --seconds 20
    """
    with tempfile.TemporaryDirectory() as name:
        os.environ[_stamps.FOLDER] = name
        measured = measure_ours(seconds, Path(name))
        ray.shutdown()
        stamps = _read(Path(name))
    worked = [stream for stream, steps in stamps.items() if "work" in steps and "encode" in steps]
    hops = sorted(worked, key=lambda stream: min(stamps[stream]["work"].values()))
    report = Report(f"steps of a frame, {WIDTH}x{HEIGHT} at {RATE}/s", UNITS, packages=("ray",))
    for step, (begin, end) in _STEPS.items():
        figures = [_between(stamps[stream][begin], stamps[stream][end]) for stream in hops]
        report.row(step, dict(zip(_HOPS, figures, strict=True)))
    whole = [_between(stamps[stream]["encode"], stamps[stream]["work"]) for stream in hops]
    report.row("the hop", dict(zip(_HOPS, whole, strict=True)))
    work = [
        _until_next(stamps[stream]["work"], stamps[after]["encode"])
        for stream, after in pairwise(hops)
    ]
    report.row("the work after it", dict(zip(_HOPS, [*work, math.nan], strict=True)))
    middle, high = statistics.median(measured.latencies), _high(measured.latencies)
    report.note(f"capture to command: {middle:.2f} ms, p99 {high:.2f} ms; CPU {measured.cpu:.1f} %")
    report.show()
    if json_path is not None:
        report.write(json_path)


def _high(latencies: list[float]) -> float:
    return statistics.quantiles(latencies, n=100)[-1]


if __name__ == "__main__":
    typer.run(main)
