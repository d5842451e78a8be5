"""Checks a user's analytics scheduler against the protocol, in the lab.

In the plug-in's own tests::

    from aerodaas.testing.scheduler_kit import check_scheduler

    def test_mine_keeps_the_protocol():
        check_scheduler("mine.py:Mine")

    def test_mine_runs_the_shorter_task_first():
        ends = play(Mine(), [(0, long), (0, short)])
        assert ends[1] == End("edge", "done", 0, 90)
"""

from __future__ import annotations

import copy
import pickle
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import AeroDaaSError, SchedulerError
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    AnalyticsScheduler,
    Profile,
    Resources,
    Task,
)
from aerodaas.schedulers.analytics.registry import load_scheduler
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import Trace, simulate
from aerodaas.schedulers.lab.workload import Workload

__all__ = ["End", "check_scheduler", "play"]

_CASES: tuple[tuple[str, str, str, Resources], ...] = (
    ("2D-P", "nominal", "steady", Resources()),
    ("4D-A", "lognormal:0.3", "steady", Resources()),
    ("12D-A", "nominal", "trapezium", Resources()),
    ("3D-A", "lognormal:0.15", "outage:4-9", Resources(cloud_timeout=3 * NANOSECONDS)),
    ("3D-A", "nominal", "steady", Resources(cloud_slots=0)),
    ("4D-A", "gamma:0.5", "steady", Resources(cloud_slots=2)),
)


def check_scheduler(
    wanted: str | type[AnalyticsScheduler] | AnalyticsScheduler, *, seconds: float = 15.0
) -> None:
    """Run the scheduler over light, heavy, varying, cut-off and cloudless cases.

    Raises SchedulerError that says in which case which rule was broken: each task is decided
    exactly once; no decision is about the past, a busy executor or a cloud
    that does not exist; the same events bring the same decisions; tasks are left as they are;
    the instance survives copying and pickling. `seconds` of workload are simulated per case.
    """
    scheduler = load_scheduler(wanted)
    name = type(scheduler).__name__
    try:
        pickle.dumps(scheduler)
        copy.deepcopy(scheduler)
    except Exception as error:
        raise SchedulerError(
            f"{name} cannot be copied to where it runs ({error!r}); keep no files, locks, "
            "threads or lambdas in it"
        ) from error
    for workload, times, network, resources in _CASES:
        case = (
            f"{name}, {workload}, {times} times, {network} network, {resources.cloud_slots} slots"
        )
        duration = int(seconds * NANOSECONDS)
        path = SamplePath.draw(
            Workload.named(workload, duration),
            0,
            0,
            ExecutionTimes.named(times),
            Network.named(network, duration),
        )
        first = _simulate(path, scheduler, resources, case)
        _check_complete(path, first, case)
        second = _simulate(path, scheduler, resources, case)
        if _summary(first) != _summary(second):
            raise SchedulerError(
                f"{case}: two runs over the same events differ; seed every random number, keep "
                "nothing between runs in class or module variables, and do not iterate over sets"
            )


class End(NamedTuple):
    """How one task ended."""

    place: str
    outcome: str
    started: float
    """Milliseconds."""
    finished: float


def play(
    scheduler: AnalyticsScheduler,
    tasks: Sequence[tuple[float, Profile]],
    *,
    edge_ms: Sequence[float] = (),
    cloud_ms: Sequence[float] = (),
    network: Network | None = None,
    resources: Resources | None = None,
) -> list[End]:
    """Play a hand-written case: tasks as (arrival in ms, profile), in order of arrival.

    Executions take their profile's time, or `edge_ms` and `cloud_ms` where given. Returns the
    ends in the order of the tasks.
    """
    path = SamplePath(
        [
            Task(number, profile, at, at + profile.deadline)
            for number, (ms, profile) in enumerate(tasks)
            for at in [round(ms * MILLISECOND)]
        ],
        [round(ms * MILLISECOND) for ms in edge_ms] or [p.edge_time for _, p in tasks],
        [round(ms * MILLISECOND) for ms in cloud_ms] or [p.cloud_time for _, p in tasks],
        network or Network(),
    )
    trace = simulate(path, scheduler, resources)
    return [
        End(r.place.value, r.outcome.value, r.started / MILLISECOND, r.finished / MILLISECOND)
        for r in sorted(trace.results, key=lambda r: r.task.id)
    ]


def _simulate(
    path: SamplePath, scheduler: AnalyticsScheduler, resources: Resources, case: str
) -> Trace:
    before = [(task.id, task.arrival, task.deadline) for task in path.tasks]
    try:
        trace = simulate(path, scheduler, resources)
    except AeroDaaSError as error:
        raise SchedulerError(f"{case}: {error}") from error
    except Exception as error:
        raise SchedulerError(f"{case}: it raised {error!r}") from error
    if before != [(task.id, task.arrival, task.deadline) for task in path.tasks]:
        raise SchedulerError(
            f"{case}: it changed a task; tasks are shared and must stay as they are"
        )
    return trace


def _check_complete(path: SamplePath, trace: Trace, case: str) -> None:
    if trace.undecided:
        task = trace.undecided[0]
        raise SchedulerError(
            f"{case}: lost {len(trace.undecided)} of {len(path.tasks)} tasks, the first being "
            f"task {task.id} ({task.profile.model}); run, send or drop each one, with a WakeAt "
            "where nothing else happens before its deadline"
        )
    ends = Counter(result.task.id for result in trace.results)
    if sum(ends.values()) != len(path.tasks) or len(ends) != len(path.tasks):
        raise SchedulerError(f"{case}: {len(path.tasks)} tasks arrived, {len(ends)} ended")


def _summary(trace: Trace) -> list[tuple[int, str, int]]:
    return [(r.task.id, r.outcome.value, r.finished) for r in trace.results]
