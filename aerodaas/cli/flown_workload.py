"""Workload for the lab from a recorded flight: its arrivals and the observed times."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from statistics import median

from aerodaas.cli.flown_tasks import Flown, FlownTask
from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import Result, Task, TaskPlace
from aerodaas.schedulers.lab.simulator import Trace
from aerodaas.schedulers.lab.workload import Arrival, Workload

__all__ = ["flown_trace", "flown_workload"]


def flown_workload(flown: Flown) -> Workload:
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


def flown_trace(flown: Flown, tasks: list[Task]) -> Trace:
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

    def __init__(self, flown: Flown, place: TaskPlace) -> None:
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


def _arrivals(flown: Flown) -> Iterator[Arrival]:
    observed = {place: _Observed(flown, place) for place in (TaskPlace.EDGE, TaskPlace.CLOUD)}
    for task in flown.tasks:
        times = {place: one.estimate(task) for place, one in observed.items()}
        if task.took is not None:
            times[task.place] = task.took
        yield Arrival(
            task.arrival,
            task.model,
            task.source,
            edge_time=times[TaskPlace.EDGE],
            cloud_time=times[TaskPlace.CLOUD],
            reserve=task.reserve,
        )
