"""Simulated seconds per wall second: Farm Survey with its camera at 640 x 360, 15 per second.

The whole application flies: physics, rendering, streams, recording with JPEG pictures.
"""

from __future__ import annotations

import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from _report import Report
from rich.progress import track

APPLICATION = Path(__file__).parents[1] / "apps" / "farm_survey.py"
UNITS = {"simulated": "s", "wall": "s", "factor": "s/s", "ready after": "s"}
_LINE = re.compile(r"flew ([\d.]+) s in ([\d.]+) s, .*ready after ([\d.]+) s")


def fly(folder: Path, *settings: str) -> tuple[float, float, float]:
    """Fly once; returns mission seconds, wall seconds in flight, and seconds until ready."""
    command = [sys.executable, "-m", "aerodaas", "run", str(APPLICATION), "--speed", "max"]
    for setting in settings:
        command += ["--set", setting]
    command += ["--record", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - ours
    found = _LINE.search(done.stdout)
    if found is None:
        sys.exit(f"the flight failed:\n{done.stdout}\n{done.stderr}")
    mission, wall, ready = (float(text) for text in found.groups())
    return mission, wall, ready


def main(
    rounds: Annotated[int, typer.Option(min=1, help="Flights of each kind.")] = 3,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Fly Farm Survey as fast as the machine goes, with and without recording pictures.

    python benchmarks/simulation.py --rounds 3 --json simulation.json
    """
    report = Report("Farm Survey, simulated", UNITS, packages=["ray", "panda3d"])
    cases = {"as the app is": (), "pictures not recorded": ("recording.images=none",)}
    flights: dict[str, list[tuple[float, float, float]]] = {name: [] for name in cases}
    with tempfile.TemporaryDirectory() as folder:
        for number in track(range(rounds), description="flying"):
            for index, (name, settings) in enumerate(cases.items()):
                place = Path(folder) / f"{number}-{index}"
                flights[name].append(fly(place, *settings))
    for name, flown in flights.items():
        mission, wall, ready = (statistics.median(column) for column in zip(*flown, strict=True))
        factor = statistics.median(one / two for one, two, _ in flown)
        figures = (mission, wall, factor, ready)
        report.row(name, dict(zip(UNITS, figures, strict=True)))
    report.note(f"medians of {rounds} flights")
    report.show()
    if json is not None:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
