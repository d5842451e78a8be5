"""The same scheduler, the same workload: live over Ray actors, and simulated in the lab.

Live, cameras deliver one frame a second, the dispatcher's actor drives the scheduler with the
wall clock, and `SyntheticAnalytics` take the published models' times on the edge and in the
cloud. What this machine takes on the way to an executor and back is measured first and taken off
the synthetic times, as the table's times include it. The lab then simulates the recorded flight:
each task arrives when it did, and takes the time that was observed where it ran, or what it
would have taken there at that time (`aerodaas.commands.flown_workload`). So both see the same
machine, busy as it may be.
"""

from __future__ import annotations

import json as json_module
import tempfile
import time
from dataclasses import dataclass, field
from itertools import compress
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from _report import Report
from rich.progress import track

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.analytics import SyntheticAnalytics
from aerodaas.clock import NANOSECONDS
from aerodaas.commands.flown_workload import flown_workload
from aerodaas.options import RunOptions, current_options
from aerodaas.recording.reader import Recording
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile
from aerodaas.schedulers.analytics.profiles import ACTIVE, PASSIVE, PUBLISHED
from aerodaas.schedulers.analytics.registry import load_scheduler
from aerodaas.schedulers.lab.metrics import Score, score
from aerodaas.schedulers.lab.network import Network
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import simulate
from aerodaas.schedulers.lab.times import ExecutionTimes

UNITS = {
    "completion": "%",
    "utility": "1/s",
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
    content = {
        "robots": [
            {
                "id": "drone",
                "driver": "simulated",
                "sensors": [{"id": f"camera{n}", **camera} for n in range(drones)],
            }
        ],
        "compute": [{"id": "edge"}, {"id": "cloud", "kind": "cloud", "executors": 32}],
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
    current_options.set(RunOptions(speed=1.0, lockstep=False, view=False, record=folder / "run"))
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


@dataclass
class Live:
    """What a recording says of a flight's tasks."""

    arrived: dict[str, int] = field(default_factory=dict)
    """By task, as are all of these; nanoseconds."""
    place: dict[str, str] = field(default_factory=dict)
    took: dict[str, int] = field(default_factory=dict)
    outcome: dict[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path) -> Live:
        """Read a recording."""
        live = cls()
        began: dict[str, int] = {}
        with Recording.open(path) as opened:
            for record in opened.records(schemas=["aerodaas.Decision"]):
                value = record.value
                task, action, stamp = value["task"], value["action"], value["stamp"]
                arrival = stamp - round(value["values"]["waited_ms"] * MILLISECOND)
                live.arrived.setdefault(task, arrival)
                if action in {"edge", "cloud"}:
                    live.place[task], began[task] = action, stamp
                elif action in {"done", "late"}:
                    live.place[task] = value["reason"].partition(":")[0]
                    # A busy recorder may have lost the decision.
                    if task in began:
                        live.took[task] = stamp - began[task]
                live.outcome[task] = action
        return live

    def beyond(self, profiles: dict[str, Profile], place: str) -> list[float]:
        """Milliseconds beyond its nominal time that each execution took."""
        found = []
        for task, took in self.took.items():
            if self.place[task] == place:
                profile = profiles[_model(task)]
                nominal = profile.edge_time if place == "edge" else profile.cloud_time
                found.append((took - nominal) / MILLISECOND)
        return found

    def judged(self, until: int) -> list[bool]:
        """Whether each task, in order of arrival, came before `until` and its end is known."""
        return [
            self.arrived[task] < until and self.outcome[task] not in {"edge", "cloud", "retry"}
            for task in sorted(self.arrived, key=self.arrived.__getitem__)
        ]

    def score(self, profiles: dict[str, Profile], judged: list[bool]) -> Score:
        """Judge tasks as the lab does."""
        score = Score()
        ordered = sorted(self.arrived, key=self.arrived.__getitem__)
        for task in compress(ordered, judged):
            profile, place = profiles[_model(task)], self.place.get(task)
            done = self.outcome[task] == "done"
            ran = self.outcome[task] in {"done", "late", "timeout", "failed"}
            cost = profile.edge_cost if place == "edge" else profile.cloud_cost
            score.tasks += 1
            score.done += done
            score.late += ran and not done
            score.dropped += not ran
            score.on_edge += ran and place == "edge"
            score.qos += profile.benefit * done - cost * ran
        return score


def _model(task: str) -> str:
    return task.partition("#")[0].rpartition("/")[2].upper()


def simulated(path: Path, scheduler: str, judged: list[bool]) -> Score:
    """What the lab makes of a recorded flight, by the tasks that are to be judged."""
    workload, resources = flown_workload(path)
    sample = SamplePath.draw(workload, 0, 0, ExecutionTimes(), Network())
    trace = simulate(sample, load_scheduler(scheduler), resources)
    trace.results = [result for result in trace.results if judged[result.task.id]]
    return score([task for task in sample.tasks if judged[task.id]], trace)


def _figures(found: Score, seconds: float, beyond: list[float]) -> dict[str, float]:
    p50, p95 = np.percentile(beyond, [50, 95]) if beyond else (0.0, 0.0)
    return {
        "completion": 100 * found.completion,
        "utility": found.qos / seconds,
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
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Compare completion and utility of live runs with the lab's on the same tasks.

    python benchmarks/lab_vs_live.py --schedulers ec_edf,dems --drones 2 --seconds 60
    """
    profiles = [PUBLISHED[model] for model in _WORKLOADS[models]]
    by_name = {profile.model: profile for profile in profiles}
    report = Report("lab and live", UNITS, packages=["ray"])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        before = Live.read(fly("ec_edf", drones, profiles, 15.0, {}, folder / "calibration"))
        overhead = {
            place: float(np.median(measured))
            for place in ("edge", "cloud")
            if (measured := before.beyond(by_name, place))
        }
        taken = ", ".join(f"{place} {took:.1f} ms" for place, took in overhead.items())
        report.note(f"median way to an executor and back, taken off the synthetic times: {taken}")
        for scheduler in track(schedulers.split(","), description="flying live"):
            path = fly(scheduler, drones, profiles, seconds, overhead, folder / scheduler)
            live = Live.read(path)
            began, end = min(live.arrived.values()), max(live.arrived.values()) - _TAIL
            judged = live.judged(end)
            flown = live.score(by_name, judged)
            studied = simulated(path, scheduler, judged)
            length = (end - began) / NANOSECONDS
            beyond = live.beyond(by_name, "edge")
            report.row(f"{scheduler}, live", _figures(flown, length, beyond))
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
