"""How punctual the setpoint loop is on a busy machine: gaps between the setpoints of a flight.

    python benchmarks/punctuality.py --seconds 300 --busy 8

flies a simulated drone at wall speed by the drone's own actor while so many processes at normal
niceness compute, first plainly (workers at Ray's own niceness of 15, no measures), then with them.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
import psutil
import typer
from _report import Report

from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint
from aerodaas.actors.cluster import ray_cluster as cluster
from aerodaas.actors.cluster.ray_variables import VARIABLES
from aerodaas.actors.priority import SWITCH
from aerodaas.config.options import RunOptions, current_options
from aerodaas.recording.reader import Recording

_PERIOD = 50.0
_LATE = 250.0
_CLOSE = 20.0
"""Milliseconds off the period within which a setpoint counts as punctual."""
UNITS = {
    "setpoints": "",
    "p50": "ms",
    "p99": "ms",
    "max": "ms",
    "within 20 ms": "%",
    "later than 250 ms": "",
}
_NICENESS = "RAY_worker_niceness"
_PLAIN = {SWITCH: "off", _NICENESS: "15"}
_MEASURED = {SWITCH: "", _NICENESS: VARIABLES[_NICENESS]}


def _compute() -> None:
    while True:
        sum(range(10_000))


@contextmanager
def _busy(count: int) -> Iterator[None]:
    """So many processes that never wait; they end with the block."""
    processes = [multiprocessing.Process(target=_compute, daemon=True) for _ in range(count)]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.join()


def _environment(folder: Path) -> Path:
    sensors = [{"id": "odometry", "type": "odometry", "rate": 10}]
    content = {
        "name": "punctuality",
        "robots": [{"id": "drone", "driver": "simulated", "sensors": sensors}],
        "simulation": {"world": "empty"},
    }
    path = folder / "punctuality.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def measure(seconds: float, busy: int, folder: Path, settings: dict[str, str]) -> list[float]:
    """Milliseconds between the setpoints of a flight of `seconds`, from its start to its end."""
    os.environ.update(settings)
    current_options.set(
        RunOptions(speed=1.0, simulated_time=False, view=False, record=folder / "flight")
    )
    env = Environment(_environment(folder))
    drone = env.get_robot_by_id("drone")
    drone.get_sensor_by_id("odometry").get_data_stream()
    stop = Waypoint("there", 3.0, 0.0, 3.0, hover_duration=10 * seconds)
    drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [stop]))
    drone.start_mission(wait=False)
    with _busy(busy):
        time.sleep(seconds)
    drone.end_mission()
    drone.wait()
    cluster.disconnect()
    with Recording.open(folder / "flight" / "flight.mcap") as recording:
        records = recording.records(schemas=("aerodaas.Setpoint",))
        stamps = [record.value.stamp / 1e6 for record in records]
    return list(np.diff(stamps))


def figures(gaps: list[float]) -> dict[str, float]:
    """The figures of the milliseconds between setpoints."""
    values = np.array(gaps)
    p50, p99 = np.percentile(values, [50, 99])
    return {
        "setpoints": values.size,
        "p50": float(p50),
        "p99": float(p99),
        "max": float(values.max()),
        "within 20 ms": 100 * float(np.mean(np.abs(values - _PERIOD) <= _CLOSE)),
        "later than 250 ms": int(np.sum(values > _LATE)),
    }


def main(
    seconds: Annotated[float, typer.Option(min=5, help="of each flight")] = 60.0,
    busy: Annotated[int, typer.Option(min=0, help="processes that compute meanwhile")] = 8,
    *,
    plain: Annotated[bool, typer.Option(help="only without the measures")] = False,
    measures: Annotated[bool, typer.Option(help="only with them")] = False,
    json_path: Annotated[Path | None, typer.Option("--json", help="Write the figures.")] = None,
) -> None:
    """Measure the gaps between setpoints, in milliseconds."""
    report = Report(f"setpoints beside {busy} busy processes", UNITS, packages=("ray",))
    rounds = {"plain": _PLAIN, "with the measures": _MEASURED}
    for name, settings in rounds.items():
        if (plain and name != "plain") or (measures and name == "plain"):
            continue
        load = psutil.getloadavg()[0]
        with tempfile.TemporaryDirectory() as folder:
            gaps = measure(seconds, busy, Path(folder), settings)
        report.row(name, figures(gaps))
        report.note(f"{name}: {load:.1f} processes wanted to run when it began")
    report.note(f"flights of {seconds:g} s, a setpoint every {_PERIOD:g} ms")
    report.show()
    if json_path is not None:
        report.write(json_path)


if __name__ == "__main__":
    typer.run(main)
