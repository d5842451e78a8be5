"""How long one waits for `import aerodaas`, `aerodaas --help` and a drone's take-off.

From the moment at which the process is asked for until it has ended, the interpreter's own start
included; to take-off, until the drone of `footprint.py`'s case "hover" leaves the ground, in real
time and recorded. The first run of each is not counted, so that files are in memory and compiled.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from _report import Report
from footprint import flying, read
from rich.progress import track

UNITS = {"median": "s", "least": "s", "processor": "s"}
TAKE_OFF = "command to take-off"
COMMANDS = {
    "python": ("-c", ""),
    "import aerodaas": ("-c", "import aerodaas"),
    "from aerodaas import Environment": ("-c", "from aerodaas import Environment"),
    "aerodaas --help": ("-m", "aerodaas", "--help"),
}
"""Words for the interpreter by case; the first tells what it takes by itself."""
_ROOT = Path(__file__).resolve().parents[1]


def run(words: tuple[str, ...]) -> tuple[float, float]:
    """Run the interpreter once; returns the seconds that it took by the wall and of processor."""
    before, began = _processor(), time.perf_counter()
    subprocess.run(  # noqa: S603 - ours
        [sys.executable, *words],
        check=True,
        stdout=subprocess.DEVNULL,
        cwd=_ROOT,
        env={**os.environ, "PYTHONPATH": str(_ROOT)},
    )
    return time.perf_counter() - began, _processor() - before


def _processor() -> float:
    """Seconds that the children which have ended took of the processor."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def take_off() -> tuple[float, float]:
    """Fly once; returns seconds to take-off, by the wall and of all processes' processor."""
    with (
        tempfile.TemporaryDirectory() as folder,
        flying(Path(folder), "hover", Path(sys.executable), _ROOT) as (process, seconds),
    ):
        return seconds, sum(reading.processor for reading in read(process).values())


def figures(once: Callable[[], tuple[float, float]], count: int, case: str) -> dict[str, float]:
    """Measure `count` times after a first time that does not count."""
    once()
    taken = [once() for _ in track(range(count), case, transient=True)]
    walls, processor = zip(*taken, strict=True)
    found = (statistics.median(walls), min(walls), statistics.median(processor))
    return dict(zip(UNITS, found, strict=True))


def main(
    runs: Annotated[int, typer.Option(min=1, help="Runs of each command.")] = 9,
    flights: Annotated[int, typer.Option(min=0, help="Flights to take-off; 0 for none.")] = 3,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Measure how long commands take to answer, and a drone to take off.

    python benchmarks/start.py --runs 9 --flights 3
    """
    report = Report("start", UNITS, packages=["ray"])
    for case, words in COMMANDS.items():
        report.row(case, figures(partial(run, words), runs, case))
    if flights:
        report.row(TAKE_OFF, figures(take_off, flights, TAKE_OFF))
    report.note(f"medians of {runs} runs and {flights} flights, each after one that is not counted")
    report.show()
    if json is not None:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
