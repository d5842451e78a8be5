"""Workload for the lab from a recorded flight: its arrivals and the observed times."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.errors import RecordingError
from aerodaas.messages.mission import Decision
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorded_environment import allowed_content, merged, recorded_content
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    Profile,
    Resources,
    Result,
    Task,
    TaskOutcome,
    TaskPlace,
)
from aerodaas.schedulers.analytics.published.profiles import told_profile
from aerodaas.schedulers.lab.simulator import Trace
from aerodaas.schedulers.lab.workload import TaskArrival, Workload

__all__ = ["FlownTask", "RecordedWorkload", "flown_trace", "flown_workload"]

_ENDS = {"drop": TaskOutcome.DROPPED} | {outcome.value: outcome for outcome in TaskOutcome}
_ANSWERED = (TaskOutcome.DONE, TaskOutcome.LATE)
_PLACES = {place.value: place for place in TaskPlace}


@dataclass(slots=True)
class FlownTask:
    """One task of the flight; stamps and durations in nanoseconds."""

    model: str
    source: str
    arrival: int
    number: int
    """Number of its arrival: the tasks of one frame arrive at the same time, but in order."""
    reserve: int
    began: int | None = None
    place: TaskPlace = TaskPlace.NOWHERE
    """Place where its execution began."""
    ended: int = 0
    outcome: TaskOutcome | None = None
    """None if the flight was over before."""
    why: str = ""
    """Reason of the last decision about it."""

    @property
    def took(self) -> int | None:
        """Duration of its execution, if answered."""
        answered = self.outcome in _ANSWERED and self.began is not None
        return self.ended - (self.began or 0) if answered else None

    def apply(self, decision: Decision) -> None:
        """Update by a recorded decision or outcome."""
        action, reason = decision.action, decision.reason
        if action in {"edge", "cloud"}:
            self.began, self.place, self.why = decision.stamp, TaskPlace(action), reason
        elif action in _ENDS:
            self.outcome, self.ended = _ENDS[action], decision.stamp
            if action == "drop":
                self.place, self.why = TaskPlace.NOWHERE, reason
            else:
                # A busy recorder may have lost the decision.
                named = reason.partition(":")[0]
                self.place = _PLACES.get(named, TaskPlace.NOWHERE)


@dataclass(frozen=True)
class RecordedWorkload:
    """Tasks of a recording, with the decisions of its analytics scheduler."""

    name: str
    tasks: list[FlownTask]
    """In order of arrival."""
    models: dict[str, Profile]
    """Their profiles in the environment."""
    resources: Resources

    @classmethod
    def read(cls, path: str | Path) -> RecordedWorkload:
        """Read a recording.

        Raises RecordingError for one without decisions or without its environment.
        """
        with Recording.open(path) as recording:
            decisions = [r.value for r in recording.records(schemas=["aerodaas.Decision"])]
            tasks = _tasks(one for one in decisions if "waited_ms" in one.values)
            if not tasks:
                raise RecordingError(
                    f"{path} holds no decisions of an analytics scheduler; fly with one, such as "
                    '"schedulers": {"analytics": "dems"} in the environment file'
                )
            content = merged(allowed_content(recorded_content(recording)), {})
            simulated_time = recording.provenance.get("speed") == "max"
        environment = validated(content, f"the environment in {path}")
        told = environment.schedulers
        models = {name: told_profile(name, told) for name in sorted({t.model for t in tasks})}
        return cls(
            Path(path).stem, tasks, models, Resources(_cloud_slots(environment, simulated_time))
        )


def _tasks(decisions: Iterable[Decision]) -> list[FlownTask]:
    found: dict[str, FlownTask] = {}
    for decision in decisions:
        name, figures = decision.task, decision.values
        task = found.get(name)
        if task is None:
            model, _, frame = name.partition("#")
            task = found[name] = FlownTask(
                model,
                frame.rpartition(":")[0],
                decision.stamp - round(figures["waited_ms"] * MILLISECOND),
                int(figures.get("number", 0)),
                round(figures.get("reserve_ms", 0.0) * MILLISECOND),
            )
        task.apply(decision)
    return sorted(found.values(), key=lambda task: (task.arrival, task.number))


def _cloud_slots(environment: EnvironmentConfig, simulated_time: bool) -> int:  # noqa: FBT001
    if environment.compute == "auto":
        return Resources().cloud_slots
    clouds = [one for one in environment.compute if one.kind == "cloud"]
    # A simulated cloud was there in simulated time alone.
    return sum(one.executors for one in clouds if simulated_time or not one.simulated)


def flown_workload(flown: RecordedWorkload) -> Workload:
    """Make a workload of the tasks that a flight's analytics scheduler decided on.

    Each task arrives when it did. Its time where it ran is the one observed. Where it did not
    run, it is what its model usually took there, plus what the execution there that was nearest
    in time took beyond its own model's usual time: so a slow network is slow for every
    scheduler. Benefits, deadlines and costs are the environment's.
    """
    return Workload(
        flown.name,
        flown.models,
        duration=flown.tasks[-1].arrival + NANOSECONDS,
        arrivals=tuple(_arrivals(flown)),
    )


def flown_trace(flown: RecordedWorkload, tasks: list[Task]) -> Trace:
    """Trace of a flight, in the lab's format.

    `tasks` are those of `flown_workload`. So the same code evaluates flight and lab.
    """
    trace = Trace(end=max(one.ended for one in flown.tasks))
    for task, one in zip(tasks, flown.tasks, strict=True):
        trace.reasons[one.why] += 1
        if one.outcome is None:
            trace.undecided.append(task)
        else:
            began = one.ended if one.began is None else one.began
            trace.results.append(Result(task, one.outcome, one.place, began, one.ended))
    return trace


class _Observed:
    """Execution times in one place: those of each model, and their change in the flight."""

    def __init__(self, flown: RecordedWorkload, place: TaskPlace) -> None:
        seen = [
            (one.began, one.model, one.took)
            for one in flown.tasks
            if one.place is place and one.began is not None and one.took is not None
        ]
        self._typical = {
            name: profile.edge_time if place is TaskPlace.EDGE else profile.cloud_time
            for name, profile in flown.models.items()
        }
        for name in flown.models:
            if mine := [took for _, model, took in seen if model == name]:
                self._typical[name] = round(median(mine))
        seen.sort()
        self._stamps = [stamp for stamp, _, _ in seen]
        self._beyond = [took - self._typical[model] for _, model, took in seen]

    def estimate(self, task: FlownTask) -> int | None:
        """Execution time of the task at about its arrival; None if nothing ran here."""
        if not self._stamps:
            return None
        right = bisect_left(self._stamps, task.arrival)
        near = [one for one in (right - 1, right) if 0 <= one < len(self._stamps)]
        nearest = min(near, key=lambda one: abs(self._stamps[one] - task.arrival))
        return max(1, self._typical[task.model] + self._beyond[nearest])


def _arrivals(flown: RecordedWorkload) -> Iterator[TaskArrival]:
    observed = {place: _Observed(flown, place) for place in (TaskPlace.EDGE, TaskPlace.CLOUD)}
    for task in flown.tasks:
        times = {place: one.estimate(task) for place, one in observed.items()}
        if task.took is not None:
            times[task.place] = task.took
        yield TaskArrival(
            task.arrival,
            task.model,
            task.source,
            edge_time=times[TaskPlace.EDGE],
            cloud_time=times[TaskPlace.CLOUD],
            reserve=task.reserve,
        )
