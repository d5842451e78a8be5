"""A recorded flight as a workload for the lab: its tasks as they came, its times as observed."""

from __future__ import annotations

import json
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median
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

    Each task arrives when it did. Its time where it ran is the one observed. Where it did not
    run, it is what its model usually took there, plus what the execution there that was nearest
    in time took beyond its own model's usual time: so a slow network is slow for every
    scheduler. Benefits, deadlines and costs are the environment's.
    Raises RecordingError for a recording without decisions or without its environment.
    """
    with Recording.open(path) as recording:
        decisions = [r.value for r in recording.records(schemas=["aerodaas.Decision"])]
        tasks = _tasks(one for one in decisions if "waited_ms" in one["values"])
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
        arrivals=tuple(_arrivals(tasks, models)),
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


class _Observed:
    """Execution times in one place: what each model takes, and how that changed in the flight."""

    def __init__(self, tasks: list[_Flown], place: str, models: Mapping[str, Profile]) -> None:
        seen = [
            (task.began[1], task.model, task.took[1])
            for task in tasks
            if task.began is not None and task.took is not None and task.took[0] == place
        ]
        self._typical = {
            name: profile.edge_time if place == "edge" else profile.cloud_time
            for name, profile in models.items()
        }
        for name in models:
            if mine := [took for _, model, took in seen if model == name]:
                self._typical[name] = round(median(mine))
        seen.sort()
        self._stamps = [stamp for stamp, _, _ in seen]
        self._beyond = [took - self._typical[model] for _, model, took in seen]

    def estimate(self, task: _Flown) -> int | None:
        """What the task would have taken at about its arrival; None if nothing ran here."""
        if not self._stamps:
            return None
        right = bisect_left(self._stamps, task.arrival)
        near = [one for one in (right - 1, right) if 0 <= one < len(self._stamps)]
        nearest = min(near, key=lambda one: abs(self._stamps[one] - task.arrival))
        return max(1, self._typical[task.model] + self._beyond[nearest])


def _arrivals(tasks: list[_Flown], models: Mapping[str, Profile]) -> Iterator[Arrival]:
    observed = {place: _Observed(tasks, place, models) for place in ("edge", "cloud")}
    for task in tasks:
        times = {place: one.estimate(task) for place, one in observed.items()}
        if task.took is not None:
            times[task.took[0]] = task.took[1]
        yield Arrival(
            task.arrival,
            task.model,
            task.source,
            edge_time=times["edge"],
            cloud_time=times["cloud"],
            reserve=task.reserve,
        )


def _profile(environment: EnvironmentConfig, model: str) -> Profile:
    return told_profile(model, environment.schedulers.tasks)


def _cloud_slots(environment: EnvironmentConfig) -> int:
    if environment.compute == "auto":
        return Resources().cloud_slots
    return sum(one.executors for one in environment.compute if one.kind == "cloud")
