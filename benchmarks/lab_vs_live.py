"""The same scheduler, the same workload: live over Ray actors, and simulated in the lab.

Live, cameras deliver one frame a second, the dispatcher's actor drives the scheduler with the
wall clock, and `SyntheticAnalytics` take the published models' times on the edge and in the
cloud. What this machine takes on the way to an executor and back is measured first and taken off
the synthetic times, as the table's times include it. The lab then simulates the recorded flight:
each task arrives when it did, and takes the time that was observed where it ran, or what it
would have taken there at that time (`aerodaas.cli.lab.recorded_workload`). So both see the same
machine, busy as it may be.
"""

from __future__ import annotations

import json as json_module
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from _report import Report
from rich.progress import track

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.analytics import SyntheticAnalytics
from aerodaas.cli.lab.recorded_workload import (
    RecordedWorkload,
    flown_trace,
    flown_workload,
)
from aerodaas.clock import NANOSECONDS
from aerodaas.config.options import RunOptions, current_options
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile, TaskPlace
from aerodaas.schedulers.analytics.published.profiles import ACTIVE, PASSIVE, PUBLISHED
from aerodaas.schedulers.analytics.registry import load_scheduler
from aerodaas.schedulers.lab.metrics import Score, score
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import simulate

UNITS = {
    "completion": "%",
    "utility": "1/s",
    "QoE": "1/s",
    "late": "%",
    "dropped": "%",
    "on edge": "%",
    "beyond p50": "ms",
    "beyond p95": "ms",
}
_WORKLOADS = {"P": PASSIVE, "A": ACTIVE}
_TAKE_OFF = 4.0
_TAIL = 2 * NANOSECONDS
"""Tasks that arrived within so long of the end may not have ended, and do not count."""
_AIM = 5.0
"""Points by which completion, and per cent by which utility, may differ."""


def _environment(folder: Path, drones: int, profiles: list[Profile], scheduler: str) -> Path:
    camera = {"driver": "simulated", "rate": 1, "settings": {"width": 64, "height": 36}}
    tasks = {
        profile.model.lower(): {
            "benefit": profile.benefit,
            "deadline": profile.deadline / MILLISECOND,
            "edge_time": profile.edge_time / MILLISECOND,
            "cloud_time": profile.cloud_time / MILLISECOND,
            "edge_cost": profile.edge_cost,
            "cloud_cost": profile.cloud_cost,
            "qoe_bonus": profile.qoe.bonus if profile.qoe else 0,
        }
        for profile in profiles
    }
    cloud = {"id": "cloud", "kind": "cloud", "executors": 32, "compression": "none"}
    content = {
        "robots": [
            {
                "id": "drone",
                "driver": "simulated",
                "sensors": [{"id": f"camera{n}", **camera} for n in range(drones)],
            }
        ],
        "compute": [{"id": "edge"}, cloud],
        "schedulers": {"analytics": scheduler, "tasks": tasks},
        "recording": {"images": "none"},
        "simulation": {"world": "empty"},
    }
    path = folder / "live.json"
    path.write_text(json_module.dumps(content), encoding="utf-8")
    return path


def fly(
    scheduler: str,
    drones: int,
    profiles: list[Profile],
    seconds: float,
    overhead: dict[str, float],
    folder: Path,
) -> Path:
    """Run live for `seconds` in `folder`; returns the recording."""
    folder.mkdir()
    current_options.set(
        RunOptions(speed=1.0, simulated_time=False, view=False, record=folder / "run")
    )
    env = Environment(_environment(folder, drones, profiles, scheduler))
    edge = env.get_compute_resource_by_id("edge")
    drone = env.get_robot_by_id("drone")
    frames = [drone.get_sensor_by_id(f"camera{n}").get_data_stream() for n in range(drones)]
    for profile in profiles:
        times = {
            place: max(0.0, took / MILLISECOND - overhead.get(place, 0.0))
            for place, took in (("edge", profile.edge_time), ("cloud", profile.cloud_time))
        }
        model = SyntheticAnalytics(profile.model.lower(), times["edge"], times["cloud"])
        for stream in frames:
            model.deploy(edge).analyse(stream)
    stay = Waypoint("stay", 0, 0, 1.5, hover_duration=seconds + 60)
    drone.navigate(AeroNavigation(data=[stay]))
    drone.start_mission(wait=False)
    time.sleep(_TAKE_OFF + seconds)
    drone.end_mission()
    drone.wait()
    return folder / "run" / "flight.mcap"


def beyond(flown: RecordedWorkload, place: TaskPlace) -> list[float]:
    """Milliseconds beyond its nominal time that each execution took."""
    found = []
    for task in flown.tasks:
        if task.place is place and task.took is not None:
            profile = flown.models[task.model]
            nominal = profile.edge_time if place is TaskPlace.EDGE else profile.cloud_time
            found.append((task.took - nominal) / MILLISECOND)
    return found


def compared(flown: RecordedWorkload, scheduler: str) -> tuple[Score, Score]:
    """The flight's score and the lab's, of the tasks whose end the flight has seen."""
    sample = SamplePath.draw(flown_workload(flown), 0, 0, ExecutionTimes(), Network())
    live = flown_trace(flown, sample.tasks)
    lab = simulate(sample, load_scheduler(scheduler), flown.resources)
    end = sample.tasks[-1].arrival - _TAIL
    judged = {result.task for result in live.results if result.task.arrival < end}
    tasks = [task for task in sample.tasks if task in judged]
    for trace in (live, lab):
        trace.results = [result for result in trace.results if result.task in judged]
    return score(tasks, live), score(tasks, lab)


def _figures(found: Score, seconds: float, ways: list[float]) -> dict[str, float]:
    p50, p95 = np.percentile(ways, [50, 95]) if ways else (0.0, 0.0)
    return {
        "completion": 100 * found.completion,
        "utility": found.qos / seconds,
        "QoE": found.qoe / seconds,
        "late": 100 * found.late / found.tasks,
        "dropped": 100 * found.dropped / found.tasks,
        "on edge": 100 * found.on_edge / found.tasks,
        "beyond p50": float(p50),
        "beyond p95": float(p95),
    }


def main(
    schedulers: Annotated[
        str, typer.Option(help="Names, separated by commas.")
    ] = "dems,margin,ec_edf,gems",
    drones: Annotated[int, typer.Option(min=1, max=4, help="Drones on the edge.")] = 2,
    models: Annotated[str, typer.Option(help="P: four models; A: all six.")] = "A",
    seconds: Annotated[float, typer.Option(min=10, help="Seconds of each live run.")] = 60.0,
    keep: Annotated[Path | None, typer.Option(help="New folder for the recordings.")] = None,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Compare completion and utility of live runs with the lab's on the same tasks.

    python benchmarks/lab_vs_live.py --schedulers ec_edf,dems --drones 2 --seconds 60
    """
    profiles = [PUBLISHED[model] for model in _WORKLOADS[models]]
    report = Report("lab and live", UNITS, packages=["ray"])
    with tempfile.TemporaryDirectory() as name:
        folder = keep or Path(name)
        folder.mkdir(exist_ok=True)
        before = RecordedWorkload.read(
            fly("ec_edf", drones, profiles, 15.0, {}, folder / "calibration")
        )
        overhead = {
            place.value: float(np.median(measured))
            for place in (TaskPlace.EDGE, TaskPlace.CLOUD)
            if (measured := beyond(before, place))
        }
        taken = ", ".join(f"{place} {took:.1f} ms" for place, took in overhead.items())
        report.note(f"median way to an executor and back, taken off the synthetic times: {taken}")
        for scheduler in track(schedulers.split(","), description="flying live"):
            path = fly(scheduler, drones, profiles, seconds, overhead, folder / scheduler)
            seen = RecordedWorkload.read(path)
            flown, studied = compared(seen, scheduler)
            length = (seen.tasks[-1].arrival - _TAIL - seen.tasks[0].arrival) / NANOSECONDS
            report.row(f"{scheduler}, live", _figures(flown, length, beyond(seen, TaskPlace.EDGE)))
            report.row(f"{scheduler}, lab", _figures(studied, length, []))
            points = 100 * abs(studied.completion - flown.completion)
            share = 100 * abs(flown.qos / studied.qos - 1)
            verdict = "agree" if max(points, share) < _AIM else "DISAGREE"
            report.note(
                f"{scheduler}: completion differs by {points:.1f} points, "
                f"utility by {share:.1f} %: they {verdict}"
            )
    report.show()
    if json is not None:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
