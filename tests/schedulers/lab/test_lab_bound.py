"""The clairvoyant bound is above everything that can be done."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile, Task
from aerodaas.schedulers.analytics.registry import load_scheduler, scheduler_names
from aerodaas.schedulers.lab.bound import clairvoyant_bound
from aerodaas.schedulers.lab.metrics import score
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import simulate
from aerodaas.schedulers.lab.workload import Workload

_job = st.tuples(
    st.integers(0, 300), st.integers(15, 200), st.integers(15, 400), st.integers(1, 99)
)


def _best(path: SamplePath) -> float:
    """Best utility by trying every order of every subset on the edge."""
    tasks = path.tasks
    best = -1.0
    for count in range(len(tasks) + 1):
        for order in itertools.permutations(tasks, count):
            now, value = 0, 0.0
            for task in order:
                now = max(now, task.arrival) + path.edge_times[task.id]
                value += task.profile.edge_gain if now <= task.deadline else -1e9
            for task in tasks:
                in_time = task.arrival + path.cloud_times[task.id] <= task.deadline
                if task not in order and in_time:
                    value += max(task.profile.cloud_gain, 0)
            best = max(best, value)
    return best


@settings(max_examples=30)
@given(st.lists(_job, min_size=1, max_size=5), st.integers(0, MILLISECOND - 1))
def test_no_clairvoyant_exceeds_it(jobs: list[tuple[int, int, int, int]], offset: int) -> None:
    """Neither on the grid nor off it; and it promises no more than all benefits together."""
    tasks = []
    for number, (at, edge, room, benefit) in enumerate(jobs):
        profile = Profile(
            f"m{number}", benefit, room * MILLISECOND, edge * MILLISECOND, 250 * MILLISECOND, 0, 10
        )
        arrival = at * MILLISECOND + offset
        tasks.append(Task(number, profile, arrival, arrival + profile.deadline))
    tasks.sort(key=lambda task: task.arrival)
    for number, task in enumerate(tasks):
        task.id = number
    path = SamplePath(
        tasks,
        [task.profile.edge_time + offset for task in tasks],
        [task.profile.cloud_time for task in tasks],
        Network(),
    )
    best, bound = _best(path), clairvoyant_bound(path)
    assert best <= bound + 1e-6
    assert bound <= 1.01 * sum(task.profile.benefit for task in tasks)


@pytest.mark.parametrize("times", ["nominal", "lognormal:0.15", "gamma:0.6"])
@pytest.mark.parametrize("network", ["steady", "trapezium", "outage"])
@pytest.mark.parametrize("name", ["3D-P", "2D-A"])
def test_no_scheduler_exceeds_it(times: str, network: str, name: str) -> None:
    """On any workload, network and distribution, few iterations included."""
    duration = 12 * NANOSECONDS
    path = SamplePath.draw(
        Workload.named(name, duration),
        0,
        3,
        ExecutionTimes.named(times),
        Network.named(network, duration),
    )
    bound = clairvoyant_bound(path, iterations=10)
    assert clairvoyant_bound(path, iterations=1) >= bound
    for scheduler in scheduler_names():
        assert score(path.tasks, simulate(path, load_scheduler(scheduler))).qos <= bound + 1e-6


def test_it_is_close_to_the_fluid_bound_on_the_published_workloads() -> None:
    """Per second 617 for 2D-P and 870 for 2D-A; whole tasks allow at most a little less."""
    duration = 20 * NANOSECONDS
    for name, fluid in (("2D-P", 617), ("2D-A", 870)):
        path = SamplePath.draw(Workload.named(name, duration), 0, 0, ExecutionTimes(), Network())
        bound = clairvoyant_bound(path, iterations=20) / 20
        assert 0.9 * fluid < bound < 1.03 * fluid


def test_nothing_to_do_is_worth_nothing() -> None:
    """An empty path, and one whose tasks fit nowhere."""
    assert clairvoyant_bound(SamplePath([], [], [], Network())) == 0
    profile = Profile("m", 10, 5 * MILLISECOND, 50 * MILLISECOND, 50 * MILLISECOND)
    path = SamplePath(
        [Task(0, profile, 0, profile.deadline)],
        [profile.edge_time],
        [profile.cloud_time],
        Network(),
    )
    assert clairvoyant_bound(path) == 0
