"""Memory and processor of all processes of a run, from the command on and in flight.

Memory is the proportional set size (PSS), in which pages that processes share are counted once;
it falls where other work on the machine has loaded the same libraries. "own" is what a process has
written itself, whoever else runs. "to fly" is the processor's time from the command to take-off,
that of processes that have ended included; other work on the machine prolongs the wall time, but
hardly this. "wakes" counts the times that a thread gave up the processor by itself.
"""

from __future__ import annotations

import contextlib
import json as jsons
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import psutil
import typer
from _report import Report
from endurance import name_of

_ROOT = Path(__file__).resolve().parents[1]
_HOVER = Path(__file__).resolve().with_name("_hover_app.py")
_FARM = "Farm Survey"
_CAMERA = {"id": "camera", "type": "camera", "rate": 15, "settings": {"width": 640, "height": 360}}
_FURTHER = 2
"""Drones beyond the first of the case that tells what one more costs."""
UNITS = {
    "memory": "MB (PSS)",
    "own": "MB",
    "processes": "",
    "to fly": "s",
    "in flight": "% of a core",
    "wakes": "per s",
}
_SETTLE = 8.0


def _environment(drones: int, *, camera: bool) -> dict[str, Any]:
    """Environment of so many drones beside each other, each with a camera or none."""
    sensors = [{"id": "odom", "type": "odometry", "rate": 10}, *([_CAMERA] if camera else [])]
    return {
        "name": "hover",
        "robots": [
            {"id": f"drone{n}", "start": [0.0, 8.0 * n, 0.0], "sensors": sensors}
            for n in range(1, drones + 1)
        ],
        "compute": [{"id": "edge", "kind": "edge"}],
        "simulation": {"world": "field" if camera else "empty"},
    }


CASES: dict[str, dict[str, Any] | None] = {
    "hover": _environment(1, camera=False),
    "camera": _environment(1, camera=True),
    "cameras": _environment(1 + _FURTHER, camera=True),
    _FARM: None,
}
"""Environments by case: a drone that hovers without a camera, one with, several; an application."""


@dataclass(frozen=True)
class Reading:
    """One process, or several of one name."""

    memory: float = 0.0
    own: float = 0.0
    processes: int = 0
    processor: float = 0.0
    """Seconds, those of its children that have ended included."""
    wakes: int = 0
    """Voluntary context switches of its threads."""

    def __add__(self, other: Reading) -> Reading:
        return Reading(*(getattr(self, one.name) + getattr(other, one.name) for one in _FIELDS))

    def __sub__(self, other: Reading) -> Reading:
        return Reading(*(getattr(self, one.name) - getattr(other, one.name) for one in _FIELDS))


_FIELDS = fields(Reading)


def read(application: int) -> dict[str, Reading]:
    """Read all processes of a run, by name."""
    found: dict[str, Reading] = defaultdict(Reading)
    root = psutil.Process(application)
    for process in [root, *root.children(recursive=True)]:
        with contextlib.suppress(psutil.Error, OSError):
            name = re.sub(r" \d+$", "", name_of(process, application))
            memory, own = _memory(process.pid)
            used = sum(process.cpu_times()[:4])
            found[name] += Reading(memory, own, 1, used, _wakes(process.pid))
    return found


def _memory(pid: int) -> tuple[float, float]:
    """Proportional set size of a process, and what it has written itself, in MB."""
    text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    sizes = dict(re.findall(r"^(\w+): +(\d+) kB$", text, re.MULTILINE))
    return int(sizes["Pss"]) / 1024, int(sizes["Private_Dirty"]) / 1024


def _wakes(pid: int) -> int:
    count = 0
    for thread in Path(f"/proc/{pid}/task").iterdir():
        with contextlib.suppress(OSError):  # it has ended
            found = re.search(r"^voluntary_ctxt_switches:\s+(\d+)", _status(thread), re.MULTILINE)
            count += int(found[1]) if found else 0
    return count


def _status(thread: Path) -> str:
    return (thread / "status").read_text()


@contextlib.contextmanager
def flying(folder: Path, case: str, python: Path, checkout: Path) -> Iterator[tuple[int, float]]:
    """Fly a case; yields its process once all drones take off, and the seconds until then."""
    command = [str(python), "-m", "aerodaas", "run", "--speed", "1"]
    command += ["--record", str(folder / "flight")]
    content, drones = CASES[case], 1
    if content is None:
        command.append(str(_ROOT / "apps" / "farm_survey.py"))
    else:
        drones = len(content["robots"])
        environment = folder / "environment.json"
        environment.write_text(jsons.dumps(content), encoding="utf-8")
        command += [str(_HOVER), "--env", str(environment)]
    began = time.monotonic()
    with subprocess.Popen(  # noqa: S603 - ours
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        # In a checkout, `-m` would find that one's code before the path's.
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(checkout)},
    ) as process:
        assert process.stdout is not None  # noqa: S101 - asked for
        said = []
        for line in process.stdout:
            said.append(line)
            drones -= "taking_off" in line
            if not drones:
                break
        else:
            sys.exit("it never took off:\n" + "".join(said))
        yield process.pid, time.monotonic() - began
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)


@dataclass(frozen=True)
class Measured:
    """Readings of one flight, by process."""

    start: Mapping[str, Reading]
    """At take-off."""
    before: Mapping[str, Reading]
    after: Mapping[str, Reading]
    seconds: float
    """Between the last two."""
    taken_off: float
    """Seconds from the command to take-off."""

    def figures(self, names: list[str]) -> dict[str, float]:
        """Figures of the processes of these names, all together."""
        start, before, after = (
            sum((one.get(name, Reading()) for name in names), Reading())
            for one in (self.start, self.before, self.after)
        )
        spent = after - before
        return {
            "memory": after.memory,
            "own": after.own,
            "processes": after.processes,
            "to fly": start.processor,
            "in flight": 100 * spent.processor / self.seconds,
            "wakes": spent.wakes / self.seconds,
        }


def measure(case: str, python: Path, checkout: Path, seconds: float) -> Measured:
    """Fly a case once and read all its processes."""
    with (
        tempfile.TemporaryDirectory() as folder,
        flying(Path(folder), case, python, checkout) as (process, taken_off),
    ):
        start = read(process)
        time.sleep(_SETTLE)
        before, began = read(process), time.monotonic()
        time.sleep(seconds)
        after, ended = read(process), time.monotonic()
    return Measured(start, before, after, ended - began, taken_off)


def medians(flights: list[Measured]) -> dict[str, dict[str, float]]:
    """Median figures of the flights of one case: of all processes (""), and by process."""
    names = sorted(flights[0].after, key=lambda one: -flights[0].after[one].memory)
    return {
        name: {
            unit: statistics.median(one.figures([name] if name else names)[unit] for one in flights)
            for unit in UNITS
        }
        for name in ["", *names]
    }


def main(
    *,
    case: Annotated[str, typer.Option(help="Comma-separated.")] = ",".join(CASES),
    rounds: Annotated[int, typer.Option(min=1, help="Flights of each case.")] = 1,
    seconds: Annotated[float, typer.Option(help="Time in flight that is measured.")] = 15.0,
    python: Annotated[
        Path, typer.Option(help="Interpreter that flies, as of an environment without extras.")
    ] = Path(sys.executable),
    against: Annotated[
        Path | None, typer.Option(help="Another checkout, whose flights take turns with ours.")
    ] = None,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Fly drones that hover without and with a camera, and Farm Survey; measure all processes.

    python benchmarks/footprint.py --json footprint.json
    python benchmarks/footprint.py --case hover --rounds 3 --against ../before
    """
    report = Report("footprint", UNITS, packages=["ray"])
    checkouts = {"before: ": against.resolve()} if against is not None else {}
    checkouts[""] = _ROOT
    flights: dict[tuple[str, str], list[Measured]] = defaultdict(list)
    for name in case.split(",") * rounds:
        for prefix, checkout in checkouts.items():
            flights[prefix, name].append(measure(name, python, checkout, seconds))
    for (prefix, name), flown in flights.items():
        found = medians(flown)
        report.row(f"{prefix}{name}, all processes", found.pop(""))
        for process, figures in found.items():
            report.row(f"  {prefix}{name}, {process}", figures)
        waits = statistics.median(one.taken_off for one in flown)
        report.note(f"{prefix}{name}: {waits:.1f} s from command to take-off")
    for prefix in checkouts:
        if flights.keys() >= {(prefix, "camera"), (prefix, "cameras")}:
            few, many = (medians(flights[prefix, name])[""] for name in ("camera", "cameras"))
            each = {unit: (many[unit] - few[unit]) / _FURTHER for unit in UNITS}
            report.row(f"{prefix}each further drone with a camera", each)
    report.note(f"medians of {rounds} flights, in turn")
    report.show()
    if json is not None:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
