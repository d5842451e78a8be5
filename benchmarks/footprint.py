"""Memory of all processes of a run, and seconds from the command to take-off.

Memory is the proportional set size (PSS), in which pages that processes share are counted once.
"""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Annotated

import psutil
import typer
from _report import Report

APPLICATION = Path(__file__).parents[1] / "apps" / "farm_survey.py"
UNITS = {"memory": "MB (PSS)", "processes": ""}
_SETTLE = 8.0
_OURS = ("DroneActor", "SensorActor", "AnalyticsActor", "DispatcherActor", "RecorderActor")


def _kind(process: psutil.Process, application: int) -> str:
    if process.pid == application:
        return "application"
    words = " ".join(process.cmdline())
    for actor in _OURS:
        if f"ray::{actor}" in words:
            return actor
    if words.startswith("ray::IDLE"):
        return "Ray: idle workers"
    return "Ray: head, raylet, agents"


def _measure(application: int) -> dict[str, list[float]]:
    found: dict[str, list[float]] = defaultdict(list)
    root = psutil.Process(application)
    for process in [root, *root.children(recursive=True)]:
        with contextlib.suppress(psutil.NoSuchProcess):
            memory = process.memory_full_info().pss / 2**20
            found[_kind(process, application)].append(memory)
    return found


def main(
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Fly Farm Survey in real time and measure its processes once it cruises.

    python benchmarks/footprint.py --json footprint.json
    """
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "aerodaas", "run", str(APPLICATION), "--speed", "1"]
        command += ["--record", folder]
        began = time.monotonic()
        with subprocess.Popen(  # noqa: S603 - ours
            [*command, "--record", folder],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as process:
            assert process.stdout is not None  # noqa: S101 - asked for
            for line in process.stdout:
                if "taking_off" in line:
                    break
            taken_off = time.monotonic() - began
            time.sleep(_SETTLE)
            found = _measure(process.pid)
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60)
    report = Report("footprint of Farm Survey", UNITS, packages=["ray"])
    ours = [
        memory for kind, group in found.items() if not kind.startswith("Ray") for memory in group
    ]
    everything = [memory for group in found.values() for memory in group]
    report.row("all processes", {"memory": sum(everything), "processes": len(everything)})
    report.row("the framework: application, actors", {"memory": sum(ours), "processes": len(ours)})
    for kind, group in sorted(found.items()):
        report.row(f"  {kind}", {"memory": sum(group), "processes": len(group)})
    report.note(f"{taken_off:.1f} s from the command to take-off")
    report.show()
    if json is not None:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
