"""Simulated seconds per wall second, and the processor's time that each of them takes.

Farm Survey flies whole, in simulated time: physics, a camera of 640 x 360 at 15 a second, recording
with JPEG pictures. The processor's time is that of the flight's process, as the recording has it,
or of an older checkout's actors. "parts, in one process" (`_parts.py`) has drone, camera and
recorder by themselves.
"side by side" is `aerodaas run --seeds`, whose wall time includes all that comes before and after
the flights.
"""

from __future__ import annotations

import json as jsons
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from _report import Report
from rich.progress import track

from aerodaas.clock import NANOSECONDS
from aerodaas.recording.reader import Recording

_CHECKOUT = Path(__file__).resolve().parents[1]
_APPS = _CHECKOUT / "apps"
APPLICATION = _APPS / "farm_survey.py"
_PROCESSES = {
    "inline": "flight",
    "drone": "drone",
    "sensor": "camera",
    "analytics": "analyses",
    "recorder": "recorder",
}
"""Name of a process' figure, by the first part of its own; older checkouts have actors."""
UNITS = {"simulated": "s", "wall": "s", "factor": "s/s", "ready after": "s"}
UNITS |= dict.fromkeys((*_PROCESSES.values(), "all"), "ms of processor/s")
_NONE = dict.fromkeys(UNITS, float("nan"))
_LINE = re.compile(r"flew ([\d.]+) s in ([\d.]+) s, .*ready after ([\d.]+) s")
_SIDE_BY_SIDE = "side by side"
_PARTS = {
    "parts, in one process": ("--camera", "--record"),
    "parts, no camera": ("--record",),
}


def run(checkout: Path | None, folder: Path, *words: str) -> str:
    """Run Farm Survey, by another checkout's code if there is one; returns what it prints."""
    command = [sys.executable, "-m", "aerodaas", "run", str(APPLICATION), "--speed", "max"]
    done = subprocess.run(  # noqa: S603 - ours
        [*command, "--record", str(folder), *words],
        capture_output=True,
        text=True,
        check=False,
        # In a checkout, `-m` would find that one's code before the path's.
        cwd=folder.parent,
        env=_environment(checkout),
    )
    if done.returncode:
        sys.exit(f"the flight failed:\n{done.stdout}\n{done.stderr}")
    return done.stdout


def fly(checkout: Path | None, folder: Path, words: Sequence[str]) -> dict[str, float]:
    """Fly once; returns the figures."""
    found = _LINE.search(run(checkout, folder, *words))
    assert found is not None  # noqa: S101 - it has flown
    mission, wall, ready = (float(text) for text in found.groups())
    used = processor(folder / "flight.mcap")
    figures = {"simulated": mission, "wall": wall, "factor": mission / wall, "ready after": ready}
    return {**_NONE, **figures, **used, "all": sum(used.values())}


def processor(recording: Path) -> dict[str, float]:
    """Milliseconds of the processor for a simulated second, by kind of process."""
    readings: dict[str, list[tuple[int, float]]] = defaultdict(list)
    with Recording.open(recording) as opened:
        for record in opened.records(schemas=("aerodaas.Vitals",)):
            readings[record.labels.actor].append((record.stamp, record.value.cpu_seconds))
    used: dict[str, float] = defaultdict(float)
    for actor, found in readings.items():
        kind = _PROCESSES.get(actor.partition("/")[0])
        (began, before), (ended, after) = found[0], found[-1]
        if kind is not None and ended > began:
            used[kind] += 1000 * (after - before) / ((ended - began) / NANOSECONDS)
    return dict(used)


def parts(checkout: Path | None, words: Sequence[str]) -> dict[str, float]:
    """Milliseconds of the processor for a simulated second, by part of a flight in one process."""
    command = [sys.executable, str(Path(__file__).with_name("_parts.py")), *words]
    done = subprocess.run(  # noqa: S603 - ours
        command, capture_output=True, text=True, check=True, env=_environment(checkout)
    )
    return {**_NONE, **jsons.loads(done.stdout)}


def _environment(checkout: Path | None) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(checkout or _CHECKOUT)}


def fly_seeds(folder: Path, seeds: int) -> dict[str, float]:
    """Fly several seeds side by side; returns the figures of all together."""
    table, began = folder / "table.json", time.monotonic()
    folder.mkdir()
    run(None, folder / "runs", "--seeds", str(seeds), "--json", str(table))
    wall = time.monotonic() - began
    mission = sum(row["flight s"] for row in jsons.loads(table.read_text()))
    figures = {"simulated": mission, "wall": wall, "factor": mission / wall}
    return {**_NONE, **figures}


def main(
    rounds: Annotated[int, typer.Option(min=1, help="Flights of each kind.")] = 3,
    seeds: Annotated[int, typer.Option(min=0, help="Seeds side by side; 0 for none.")] = 4,
    against: Annotated[
        Path | None, typer.Option(help="Another checkout, whose flights take turns with ours.")
    ] = None,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Fly Farm Survey as fast as the machine goes, with and without pictures and camera.

    python benchmarks/simulation.py --rounds 3 --json simulation.json
    """
    report = Report("Farm Survey, simulated", UNITS, packages=["ray", "panda3d"])
    checkouts = {"": None, **({"before: ": against.resolve()} if against else {})}
    flights: dict[str, list[dict[str, float]]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cases = {
            "as the app is": (),
            "pictures not recorded": ("--set", "recording.images=none"),
            "no camera": ("--env", str(_without_camera(folder))),
        }
        for number in track(range(rounds), description="flying"):
            for case, words in cases.items():
                for prefix, checkout in checkouts.items():
                    place = folder / f"{number}-{prefix}{case}"
                    flights[prefix + case].append(fly(checkout, place, words))
            for case, words in _PARTS.items():
                for prefix, checkout in checkouts.items():
                    flights[prefix + case].append(parts(checkout, words))
        if seeds:
            flights[_SIDE_BY_SIDE].append(fly_seeds(folder / _SIDE_BY_SIDE, seeds))
    for case, flown in flights.items():
        report.row(case, {unit: statistics.median(one[unit] for one in flown) for unit in UNITS})
    report.note(f"medians of {rounds} flights; {seeds} seeds side by side, once")
    report.show()
    if json is not None:
        report.write(json)


def _without_camera(folder: Path) -> Path:
    """Environment file of the same drone, without its camera."""
    content = jsons.loads((_APPS / "environments" / "farm.json").read_text())
    for robot in content["robots"]:
        robot["sensors"] = [one for one in robot["sensors"] if one["type"] != "camera"]
    path = folder / "environment.json"
    path.write_text(jsons.dumps(content))
    return path


if __name__ == "__main__":
    typer.run(main)
