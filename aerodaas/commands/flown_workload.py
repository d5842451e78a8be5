"""A recorded flight as a workload for the lab: its tasks as they came, its times as observed."""

from __future__ import annotations

import json
import random
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerodaas.clock import NANOSECONDS
from aerodaas.config import EnvironmentConfig, validated
from aerodaas.errors import RecordingError
from aerodaas.recording.reader import Recording
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile, Resources
from aerodaas.schedulers.analytics.profiles import told_profile
from aerodaas.schedulers.lab.workload import Arrival, Workload

__all__ = ["flown_workload"]

_ANSWERED = {"done", "late"}


@dataclass(slots=True)
class _Flown:
    """One task of the flight."""

    model: str
    source: str
    arrival: int
    reserve: int
    began: tuple[str, int] | None = None
    """Where and when its execution began."""
    took: tuple[str, int] | None = None
    """Where it ran and how long that took, if an answer came."""


def flown_workload(path: str | Path) -> tuple[Workload, Resources]:
    """Make a workload of the tasks that a recorded flight's analytics scheduler decided on.

    Each task arrives when it did. Its time where it ran is the one observed; its time where it
    did not run is drawn, with a seed of its own, from those observed there of the same model, or
    the expected one if there are none. Benefits, deadlines and costs are the environment's.
    Raises RecordingError for a recording without decisions or without its environment.
    """
    with Recording.open(path) as recording:
        tasks = _tasks(record.value for record in recording.records(schemas=["aerodaas.Decision"]))
        if not tasks:
            raise RecordingError(
                f"{path} holds no decisions of an analytics scheduler; fly with one, such as "
                '"schedulers": {"analytics": "dems"} in the environment file'
            )
        if "environment.json" not in recording.attachments:
            raise RecordingError(f"{path} holds no environment, so no run of ours has written it")
        content = json.loads(recording.attachment("environment.json"))
        environment = validated(content, f"the environment in {path}")
        end = max(task.arrival for task in tasks)
    models = {name: _profile(environment, name) for name in {task.model for task in tasks}}
    workload = Workload(
        Path(path).stem,
        dict(sorted(models.items())),
        duration=end + NANOSECONDS,
        arrivals=tuple(_arrivals(tasks)),
    )
    return workload, Resources(cloud_slots=_cloud_slots(environment))


def _tasks(decisions: Iterable[dict[str, Any]]) -> list[_Flown]:
    """The tasks in order of arrival."""
    found: dict[str, _Flown] = {}
    for value in decisions:
        name, stamp, action = value["task"], value["stamp"], value["action"]
        figures = value["values"]
        task = found.get(name)
        if task is None:
            model, _, frame = name.partition("#")
            arrival = stamp - round(figures["waited_ms"] * MILLISECOND)
            reserve = round(figures.get("reserve_ms", 0.0) * MILLISECOND)
            task = found[name] = _Flown(model, frame.rpartition(":")[0], arrival, reserve)
        if action in {"edge", "cloud"}:
            task.began = action, stamp
        elif action in _ANSWERED and task.began is not None:
            task.took = task.began[0], stamp - task.began[1]
    return sorted(found.values(), key=lambda task: task.arrival)


def _arrivals(tasks: list[_Flown]) -> list[Arrival]:
    observed: dict[tuple[str, str], list[int]] = defaultdict(list)
    for task in tasks:
        if task.took is not None:
            observed[task.model, task.took[0]].append(task.took[1])
    draw = random.Random(0)

    def time(task: _Flown, place: str) -> int | None:
        if task.took is not None and task.took[0] == place:
            return task.took[1]
        known = observed[task.model, place]
        return draw.choice(known) if known else None

    return [
        Arrival(
            task.arrival,
            task.model,
            task.source,
            edge_time=time(task, "edge"),
            cloud_time=time(task, "cloud"),
            reserve=task.reserve,
        )
        for task in tasks
    ]


def _profile(environment: EnvironmentConfig, model: str) -> Profile:
    return told_profile(model, environment.schedulers.tasks)


def _cloud_slots(environment: EnvironmentConfig) -> int:
    if environment.compute == "auto":
        return Resources().cloud_slots
    return sum(one.executors for one in environment.compute if one.kind == "cloud")
