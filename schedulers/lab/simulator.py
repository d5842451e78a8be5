"""The discrete-event simulator: one edge, its cloud slots and a scheduler on a sample path."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count
from math import inf

from aerodaas.schedulers.analytics.base import (
    AnalyticsScheduler,
    Drop,
    Resources,
    Result,
    RunOnEdge,
    SendToCloud,
    Task,
    TaskOutcome,
)
from aerodaas.schedulers.analytics.dispatch import Dispatch
from aerodaas.schedulers.lab.sample import SamplePath

__all__ = ["Trace", "simulate"]

_FINISH, _LOST, _TIMER = range(3)


@dataclass(slots=True)
class Trace:
    """Events of one edge."""

    results: list[Result] = field(default_factory=list)
    reasons: Counter[str] = field(default_factory=Counter)
    """How often each reason was given for a decision."""
    undecided: list[Task] = field(default_factory=list)
    """Tasks about which the scheduler never decided."""
    end: int = 0
    """When the last event happened, nanoseconds."""
    decisions: list[tuple[int, RunOnEdge | SendToCloud | Drop]] = field(default_factory=list)
    """Filled on request."""


class _SimulatedHost:
    """Executors with the execution times of the sample path."""

    def __init__(self, path: SamplePath, resources: Resources, *, record: bool) -> None:
        self.trace = Trace()
        self.heap: list[tuple[int, int, int, Task | None]] = []
        self.closed: Callable[..., None] = self.trace.results.append
        self._numbers = count()
        self._path = path
        self._network = None if path.network.is_steady else path.network
        self._reasons = self.trace.reasons
        self._timeout = resources.cloud_timeout
        self._record = record

    def run_edge(self, task: Task, now: int) -> None:
        ends = now + self._path.edge_times[task.id]
        heappush(self.heap, (ends, _FINISH, next(self._numbers), task))

    def run_cloud(self, task: Task, now: int) -> None:
        taken: int | None = self._path.cloud_times[task.id]
        if self._network is not None:
            taken = self._network.cloud_time(self._path.cloud_times[task.id], now)
        if taken is None or taken > self._timeout:
            heappush(self.heap, (now + self._timeout, _LOST, next(self._numbers), task))
        else:
            heappush(self.heap, (now + taken, _FINISH, next(self._numbers), task))

    def wake_at(self, at: int) -> None:
        heappush(self.heap, (at, _TIMER, next(self._numbers), None))

    def decided(self, decision: RunOnEdge | SendToCloud | Drop, now: int) -> None:
        self._reasons[decision.reason] += 1
        if self._record:
            self.trace.decisions.append((now, decision))


def simulate(
    path: SamplePath,
    scheduler: AnalyticsScheduler,
    resources: Resources | None = None,
    *,
    record: bool = False,
) -> Trace:
    """Run a copy of `scheduler` over the path and return its trace.

    At one moment, ends of executions come first, then timers, then arrivals.

    Args:
        path: The path of one edge.
        scheduler: The scheduler, which stays unchanged.
        resources: The edge executor and the cloud; by default those of the class.
        record: Whether to keep every decision.

    Raises:
        SchedulerError: If a decision cannot be carried out.
    """
    resources = resources or Resources()
    host = _SimulatedHost(path, resources, record=record)
    dispatch = Dispatch(copy.deepcopy(scheduler), resources, host)
    dispatch.start(0)
    heap, trace = host.heap, host.trace
    now = 0
    for task in path.tasks:
        now = task.arrival
        if heap and heap[0][0] <= now:
            _deliver(dispatch, heap, now)
        dispatch.arrived(task, now)
    trace.end = max(now, _deliver(dispatch, heap, inf))
    trace.undecided = list(dispatch.undecided.values())
    return trace


def _deliver(
    dispatch: Dispatch, heap: list[tuple[int, int, int, Task | None]], until: float
) -> int:
    """Tell all that happens until then, and return when the last of it did."""
    now = 0
    while heap and heap[0][0] <= until:
        now, kind, _, task = heappop(heap)
        if task is None:
            dispatch.timer(now)
        elif kind == _FINISH:
            dispatch.finished(task, now)
        else:
            dispatch.finished(task, now, TaskOutcome.TIMEOUT)
    return now
