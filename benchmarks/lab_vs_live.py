"""The same scheduler, the same workload: simulated in the lab, and live over Ray actors.

Live, cameras deliver one frame a second, the dispatcher's actor drives the scheduler with the
wall clock, and `SyntheticAnalytics` take the published models' times on the edge and in the
cloud. What the live system itself takes on the way to an executor and back is measured first
and taken off the synthetic times, as the table's times include it.
"""

from __future__ import annotations

import json as json_module
import tempfile
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from _report import Report
from rich.progress import track

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.analytics import SyntheticAnalytics
from aerodaas.options import RunOptions, current_options
from aerodaas.recording.reader import Recording
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile
from aerodaas.schedulers.analytics.profiles import ACTIVE, PASSIVE, PUBLISHED
from aerodaas.schedulers.lab.run import run_lab
from aerodaas.schedulers.lab.workload import Workload

UNITS = {"completion": "%", "utility": "1/s", "late": "%", "dropped": "%"}
_WORKLOADS = {"P": PASSIVE, "A": ACTIVE}
_TAKE_OFF = 4.0
_MARGIN = 2.0
"""Milliseconds beyond the median overhead that are taken off, for it varies."""


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
    scheduler: str, drones: int, profiles: list[Profile], seconds: float, overhead: dict[str, float]
) -> tuple[dict[str, Any], dict[str, list[float]]]:
    """Run live for `seconds`; returns the dispatcher's figures and the executions' overheads."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        current_options.set(
            RunOptions(speed=1.0, lockstep=False, view=False, record=folder / "run")
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
        stay = Waypoint("stay", 0, 0, 1.5, hover_duration=seconds)
        drone.navigate(AeroNavigation(data=[stay]))
        drone.start_mission(wait=False)
        time.sleep(_TAKE_OFF + seconds)
        drone.end_mission()
        drone.wait()
        assert env.run is not None  # noqa: S101 - just flown
        figures = env.run.reports()["dispatcher"].values
        return figures, _overheads(folder / "run" / "flight.mcap", profiles)


def _overheads(recording: Path, profiles: list[Profile]) -> dict[str, list[float]]:
    """Milliseconds beyond its nominal time that each execution took, by place."""
    nominal = {
        profile.model.lower(): {
            "edge": profile.edge_time / MILLISECOND,
            "cloud": profile.cloud_time / MILLISECOND,
        }
        for profile in profiles
    }
    began: dict[str, tuple[str, float]] = {}
    beyond: dict[str, list[float]] = {"edge": [], "cloud": []}
    with Recording.open(recording) as opened:
        for record in opened.records(schemas=["aerodaas.Decision"]):
            value = record.value
            if value["action"] in beyond:
                began[value["task"]] = (value["action"], value["stamp"] / 1e6)
            elif value["action"] in {"done", "late"} and value["task"] in began:
                place, at = began.pop(value["task"])
                model = value["task"].partition("#")[0].rpartition("/")[2]
                beyond[place].append(value["stamp"] / 1e6 - at - nominal[model][place])
    return beyond


def main(
    schedulers: Annotated[str, typer.Option(help="Names, separated by commas.")] = "ec_edf,dems",
    drones: Annotated[int, typer.Option(min=1, max=4, help="Drones on the edge.")] = 2,
    models: Annotated[str, typer.Option(help="P: four models; A: all six.")] = "A",
    seconds: Annotated[float, typer.Option(min=10, help="Seconds of each live run.")] = 60.0,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Compare completion and utility of live runs with the lab's.

    python benchmarks/lab_vs_live.py --schedulers ec_edf,dems --drones 2 --seconds 60
    """
    profiles = [PUBLISHED[model] for model in _WORKLOADS[models]]
    _, measured = fly("ec_edf", drones, profiles, 15.0, {})
    overhead = {
        place: float(np.median(values)) + _MARGIN for place, values in measured.items() if values
    }
    report = Report("lab and live", UNITS, packages=["ray"])
    report.note(
        "overhead taken off the synthetic times: "
        + ", ".join(f"{place} {took:.1f} ms" for place, took in overhead.items())
    )
    workload = Workload.named(f"{drones}D-{models}").lasting(int(seconds * 1e9))
    names = schedulers.split(",")
    lab = run_lab(workload, names, range(5), bound=False)
    for name in track(names, description="flying live"):
        figures = lab.figures(name)
        studied = {
            "completion": 100 * figures["completion"].value,
            "utility": figures["qos per s"].value,
            "late": 100 * figures["late"].value,
            "dropped": 100 * figures["dropped"].value,
        }
        values, _ = fly(name, drones, profiles, seconds, overhead)
        outcomes = values["outcomes"]
        total = sum(outcomes.values())
        flown = {
            "completion": 100 * outcomes.get("done", 0) / total,
            # Per second of frames, as many as the lab's segments.
            "utility": values["utility"] / (total / len(profiles) / drones),
            "late": 100 * outcomes.get("late", 0) / total,
            "dropped": 100 * outcomes.get("dropped", 0) / total,
        }
        report.row(f"{name}, lab", studied)
        report.row(f"{name}, live", flown)
        points = abs(studied["completion"] - flown["completion"])
        share = 100 * abs(flown["utility"] / studied["utility"] - 1)
        report.note(f"{name}: completion differs by {points:.1f} points, utility by {share:.1f} %")
    report.show()
    if json is not None:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
