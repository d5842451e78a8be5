"""Memory and processor of all processes of a run, from the command on and in flight.

Memory is the proportional set size (PSS), in which pages that processes share are counted once.
"to fly" is the processor's time from the command to take-off, that of processes that have ended
included; other work on the machine prolongs the wall time, but hardly this.
"""

from __future__ import annotations

import contextlib
import json as jsons
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import psutil
import typer
from _report import Report
from endurance import name_of

_ROOT = Path(__file__).parents[1]
APPLICATIONS = {
    "Farm Survey": _ROOT / "apps" / "farm_survey.py",
    "hover": Path(__file__).with_name("_hover_app.py"),
}
HOVER = {
    "name": "hover",
    "robots": [{"id": "drone", "sensors": [{"id": "odom", "type": "odometry", "rate": 10}]}],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "empty"},
}
UNITS = {"memory": "MB (PSS)", "processes": "", "to fly": "s", "in flight": "% of a core"}
_SETTLE = 8.0


@dataclass(frozen=True)
class Reading:
    """One process, or several of one name."""

    memory: float = 0.0
    processes: int = 0
    processor: float = 0.0
    """Seconds, those of its children that have ended included."""

    def __add__(self, other: Reading) -> Reading:
        return Reading(
            self.memory + other.memory,
            self.processes + other.processes,
            self.processor + other.processor,
        )


def read(application: int) -> dict[str, Reading]:
    """Read all processes of a run, by name."""
    found: dict[str, Reading] = defaultdict(Reading)
    root = psutil.Process(application)
    for process in [root, *root.children(recursive=True)]:
        with contextlib.suppress(psutil.Error, OSError):
            memory = process.memory_full_info().pss / 2**20
            found[name_of(process, application)] += Reading(memory, 1, sum(process.cpu_times()[:4]))
    return found


@contextlib.contextmanager
def flying(folder: Path, application: Path) -> Iterator[tuple[int, float]]:
    """Fly an application; yields its process once it takes off, and the seconds until then."""
    environment = folder / "environment.json"
    environment.write_text(jsons.dumps(HOVER), encoding="utf-8")
    command = [sys.executable, "-m", "aerodaas", "run", str(application), "--speed", "1"]
    command += ["--record", str(folder / "flight")]
    command += ["--env", str(environment)] if application == APPLICATIONS["hover"] else []
    began = time.monotonic()
    with subprocess.Popen(  # noqa: S603 - ours
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None  # noqa: S101 - asked for
        said = []
        for line in process.stdout:
            said.append(line)
            if "taking_off" in line:
                break
        else:
            sys.exit("it never took off:\n" + "".join(said))
        yield process.pid, time.monotonic() - began
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)


def main(
    application: Annotated[str, typer.Option(help="Comma-separated.")] = ",".join(APPLICATIONS),
    seconds: Annotated[float, typer.Option(help="Time in flight that is measured.")] = 15.0,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Fly Farm Survey, and a drone that hovers without a camera, and measure all processes.

    python benchmarks/footprint.py --json footprint.json
    """
    report = Report("footprint", UNITS, packages=["ray"])
    for name in application.split(","):
        with (
            tempfile.TemporaryDirectory() as folder,
            flying(Path(folder), APPLICATIONS[name]) as (process, taken_off),
        ):
            start = read(process)
            time.sleep(_SETTLE)
            before, began = read(process), time.monotonic()
            time.sleep(seconds)
            after, ended = read(process), time.monotonic()
        _fill(report, name, start, before, after, ended - began)
        report.note(f"{name}: {taken_off:.1f} s from the command to take-off")
    report.show()
    if json is not None:
        report.write(json)


def _fill(
    report: Report,
    name: str,
    start: Mapping[str, Reading],
    before: Mapping[str, Reading],
    after: Mapping[str, Reading],
    seconds: float,
) -> None:
    def row(case: str, names: list[str]) -> None:
        first, earlier, now = (
            sum((one.get(kind, Reading()) for kind in names), Reading())
            for one in (start, before, after)
        )
        used = 100 * (now.processor - earlier.processor) / seconds
        report.row(
            case, dict(zip(UNITS, (now.memory, now.processes, first.processor, used), strict=True))
        )

    row(f"{name}, all processes", sorted(after))
    for kind in sorted(after):
        row(f"  {kind}", [kind])


if __name__ == "__main__":
    typer.run(main)
