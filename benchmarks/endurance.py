"""What grows during a long flight: memory, threads, files and shared memory of each process.

    python benchmarks/endurance.py --minutes 60
    python benchmarks/endurance.py --simulated-hours 8

flies one simulated drone with a small camera, an analysis and a recorder, and samples all
processes of the run. "memory" is the proportional set size (PSS), in which pages that processes
share are counted once; growth is told of what a process has for itself (USS), because the former
falls with each new process on the machine that loads the same libraries.
"""

from __future__ import annotations

import contextlib
import math
import re
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import psutil
import typer
from _endurance_app import TASKS
from _report import Report

APPLICATION = Path(__file__).with_name("_endurance_app.py")
UNITS = {
    "memory": "MB (PSS)",
    "slope": "MB/h",
    "change": "%",
    "RSS slope": "MB/h",
    "threads": "last",
    "more threads": "",
    "files": "last",
    "more files": "",
}
_SHARE = 0.25
"""Share of the samples at each end whose medians are compared."""
_FEWEST = 4
"""Fewest samples of a process that is told."""
_SHARED = Path("/dev/shm")  # noqa: S108 - where shared memory is
_PAIRS = 400
"""Most samples in the fit, which looks at all pairs of them."""


@dataclass(frozen=True)
class Sample:
    """One process at one moment."""

    moment: float
    pss: float
    own: float
    rss: float
    threads: int
    files: int


def name_of(process: psutil.Process, application: int) -> str:
    """What a process of a run is, by its command line; the same for the same part in each run."""
    if process.pid == application:
        return "application"
    words = process.cmdline()
    line = " ".join(words)
    if found := re.match(r"ray::(\w+)", line):
        return f"{found[1]} {process.pid}" if found[1] in {"IDLE", "NodeActor"} else found[1]
    for part in ("gcs_server", "raylet", "ray_process.py"):
        if any(Path(word).name == part for word in words[:5]):
            return part
    scripts = [Path(word).parent.name + "/" + Path(word).name for word in words if ".py" in word]
    return scripts[0] if scripts else Path(words[0]).name


def slope(moments: Iterable[float], values: Iterable[float]) -> float:
    """Theil and Sen's slope per hour: the median over all pairs, deaf to single jumps."""
    x, y = np.array(list(moments)) / 3600.0, np.array(list(values))
    step = max(1, len(x) // _PAIRS)
    x, y = x[::step], y[::step]
    first, second = np.triu_indices(len(x), 1)
    return float(np.median((y[second] - y[first]) / (x[second] - x[first]))) if first.size else 0.0


def change(values: list[float]) -> tuple[float, float]:
    """The medians of the first and the last quarter."""
    count = max(1, round(_SHARE * len(values)))
    return float(np.median(values[:count])), float(np.median(values[-count:]))


class Watch:
    """Samples of all processes of a run."""

    def __init__(self, application: int) -> None:
        """Watch the process `application` and all its descendants."""
        self.samples: dict[str, list[Sample]] = defaultdict(list)
        self.shared: list[tuple[float, float]] = []
        """MB below /dev/shm, by moment."""
        self._root = psutil.Process(application)
        self._names: dict[psutil.Process, str] = {}

    def sample(self, moment: float) -> None:
        """Read all processes."""
        for process in (self._root, *self._root.children(recursive=True)):
            with contextlib.suppress(psutil.Error, OSError):
                name = self._names.get(process) or name_of(process, self._root.pid)
                self._names[process] = name
                memory = process.memory_full_info()
                reading = Sample(
                    moment,
                    memory.pss / 1e6,
                    memory.uss / 1e6,
                    memory.rss / 1e6,
                    process.num_threads(),
                    process.num_fds(),
                )
                self.samples[name].append(reading)
        used = 0
        for path in _SHARED.rglob("*"):
            with contextlib.suppress(OSError):
                used += path.stat().st_blocks * 512
        self.shared.append((moment, used / 1e6))

    def until_it_ends(
        self, process: subprocess.Popen[bytes], recording: Path, every: float, limit: float
    ) -> None:
        """Sample every so many seconds from when the recording is there, at most for `limit`."""
        while process.poll() is None and not recording.exists():
            time.sleep(0.2)
        began = time.monotonic()
        number = 0
        while process.poll() is None and time.monotonic() - began <= limit:
            self.sample(time.monotonic() - began)
            number += 1
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, began + number * every - time.monotonic()))


def fly(folder: Path, seconds: float, every: float, limit: float, *, simulated_time: bool) -> Watch:
    """Fly for `seconds` of mission time and return what was seen, by wall seconds.

    Ctrl-C ends it early, with what was seen until then.
    """
    command = [sys.executable, str(APPLICATION), str(folder), "--seconds", str(seconds)]
    command += ["--simulated"] if simulated_time else []
    with (
        (folder / "log").open("w") as log,
        subprocess.Popen(command, stdout=log, stderr=log) as process,  # noqa: S603 - ours
    ):
        watch = Watch(process.pid)
        recording = folder / "flight" / "flight.mcap"
        try:
            # Ctrl-C reaches the flight, too, which then ends by itself.
            with contextlib.suppress(KeyboardInterrupt):
                watch.until_it_ends(process, recording, every, limit if simulated_time else seconds)
        finally:
            if process.poll() is None:
                process.terminate()
    return watch


def show(watch: Watch, warm_up: float, report: Report) -> None:
    """Fill the report with the samples after the warm-up."""
    for name, samples in sorted(watch.samples.items()):
        late = [one for one in samples if one.moment >= warm_up]
        if len(late) < _FEWEST or late[-1].moment < samples[-1].moment:
            continue
        first, last = change([one.own for one in late])
        moments = [one.moment for one in late]
        report.row(
            name,
            {
                "memory": late[-1].pss,
                "slope": slope(moments, (one.own for one in late)),
                "change": 100 * (last - first) / first if first else math.nan,
                "RSS slope": slope(moments, (one.rss for one in late)),
                "threads": late[-1].threads,
                "more threads": late[-1].threads - late[0].threads,
                "files": late[-1].files,
                "more files": late[-1].files - late[0].files,
            },
        )
    late_shared = [used for moment, used in watch.shared if moment >= warm_up]
    if late_shared:
        first, last = change(late_shared)
        report.note(f"Shared memory, the whole machine's: {first:.1f} MB, then {last:.1f} MB")


def main(
    minutes: Annotated[float, typer.Option(help="Length of a flight in real time.")] = 15.0,
    simulated_hours: Annotated[
        float | None, typer.Option(help="Fly this long in simulated time instead.")
    ] = None,
    warm_up: Annotated[float, typer.Option(help="Wall seconds that do not count.")] = 120.0,
    every: Annotated[float, typer.Option(help="Seconds between two samples.")] = 5.0,
    limit: Annotated[float, typer.Option(help="Most wall minutes in simulated time.")] = 600.0,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Fly one drone for long and print what grows, process by process.

    "slope" is a robust fit, "change" compares the medians of the first and the last quarter, both
    after the warm-up.
    """
    simulated_time = simulated_hours is not None
    seconds = 3600.0 * simulated_hours if simulated_hours is not None else 60.0 * minutes
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        watch = fly(folder, seconds, every, 60.0 * limit, simulated_time=simulated_time)
        size = (folder / "flight" / "flight.mcap").stat().st_size / 1e6
        said = (folder / "log").read_text(encoding="utf-8")
    title = f"{seconds / 3600.0:g} simulated hours" if simulated_time else f"{minutes:g} minutes"
    report = Report("endurance", UNITS, packages=["ray", "mcap"])
    show(watch, warm_up, report)
    last = watch.shared[-1][0] if watch.shared else 0.0
    report.note(f"{title}, {last:.0f} s by the wall; the recording has {size:.0f} MB")
    for line in said.splitlines():
        if line.startswith(TASKS):
            report.note(line)
    report.show()
    if json is not None:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
