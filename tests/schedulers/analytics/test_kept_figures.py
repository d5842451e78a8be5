"""What schedulers keep from event to event equals what they would reckon anew each time."""

from __future__ import annotations

import random
from bisect import bisect_right
from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import (
    MIGRATED,
    MILLISECOND,
    Profile,
    QoeGoal,
    Resources,
    Task,
)
from aerodaas.schedulers.analytics.estimates import TimeEstimate, chance
from aerodaas.schedulers.analytics.planner import Job, JobQueue, plan
from aerodaas.schedulers.analytics.published.dems_a import TOLERANCE, WINDOW, _Estimate
from aerodaas.schedulers.analytics.published.edge_cloud import EdgeCloudEdf, EdgeCloudSjf
from aerodaas.schedulers.analytics.published.gems import Gems
from aerodaas.schedulers.analytics.sfq_dems import SfqDems, _Tenant, _TenantDems
from aerodaas.schedulers.analytics.windows import QoeWindows
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import simulate
from aerodaas.schedulers.lab.workload import Workload

MS = MILLISECOND
_IDLE_SHARE = 0.5

Step = tuple[float, JobQueue, Job]
State = tuple[float, float, tuple[int, ...], tuple[Step, ...]]


def plain_plan(
    lanes: list[JobQueue], start: float, until: float, price: float, width: int, gap: float
) -> list[Step]:
    """The beam search as one would write it down; a state is merit, time, places, steps."""
    beam: list[State] = [(0.0, start, (0,) * len(lanes), ())]
    ended: list[State] = []
    while beam:
        grown: dict[tuple[int, ...], State] = {}
        for state in beam:
            successors = [one for number in range(len(lanes)) for one in step(state, lanes, number)]
            successors = [
                (merit - price * (free - state[1]), free, places, steps)
                for merit, free, places, steps in successors
                if steps[-1][0] - state[1] <= gap
            ]
            for one in successors:
                rival = grown.get(one[2])
                if one[1] >= until:
                    ended.append(one)
                elif rival is None or (one[0], -one[1]) > (rival[0], -rival[1]):
                    grown[one[2]] = one
            if not successors:
                idle = price * _IDLE_SHARE * (until - state[1])
                ended.append((state[0] - idle, *state[1:]))
        beam = sorted(grown.values(), key=lambda one: -one[0])[:width]
    return list(max(ended, key=lambda one: one[0])[3])


def step(state: State, lanes: list[JobQueue], number: int) -> list[State]:
    """The state after the next job of a lane, if that can be early enough and gains anything."""
    merit, free, places, steps = state
    lane = lanes[number]
    for place in range(places[number], len(lane.jobs)):
        job = lane.jobs[place]
        if job.deadline < free + lane.time.mean - lane.time.sigma:
            continue
        begin = max(free, job.release)
        gain = job.benefit * chance(lane.time, job.deadline - begin) - job.loss
        after = (*places[:number], place + 1, *places[number + 1 :])
        end = begin + lane.time.mean
        return [(merit + gain, end, after, (*steps, (begin, lane, job)))] if gain > 0 else []
    return []


@st.composite
def lanes_to_plan(draw: st.DrawFn) -> list[JobQueue]:
    """Up to five lanes of up to four jobs, in order of release."""
    lanes = []
    for number in range(draw(st.integers(0, 5))):
        times = sorted(draw(st.lists(st.integers(0, 400), max_size=4)))
        mean = draw(st.integers(20, 300))
        jobs = [
            Job(
                (number, place),
                release,
                release + draw(st.integers(20, 700)),
                draw(st.integers(1, 200)),
                draw(st.integers(0, 60)),
            )
            for place, release in enumerate(times)
        ]
        lanes.append(
            JobQueue(TimeEstimate(float(mean), draw(st.sampled_from([1.0, 15.0, 60.0]))), jobs)
        )
    return lanes


@given(
    lanes_to_plan(),
    st.integers(0, 100),
    st.integers(200, 900),
    st.integers(1, 4),
    st.integers(0, 99),
)
def test_a_plan_is_that_of_the_plain_search(
    lanes: list[JobQueue], start: int, until: int, width: int, gap: int
) -> None:
    """Job by job, with the same starts, also where deadlines, gaps and horizons are integers."""
    found = plan(lanes, start, until, 0.125, width=width, gap=gap)
    expected = plain_plan(lanes, start, until, 0.125, width, gap)
    assert [(begin, job.what) for begin, _, job in found] == [
        (begin, job.what) for begin, _, job in expected
    ]


def profile(edge: int, tenant: str = "", weight: float = 1.0) -> Profile:
    """A model of which its time on the edge matters, in ms."""
    return Profile(
        f"m{edge}{tenant}", 10, 900 * MS, edge * MS, 300 * MS, 1, 5, tenant=tenant, weight=weight
    )


@given(
    st.randoms(use_true_random=False), st.sampled_from([EdgeCloudEdf, EdgeCloudSjf, _TenantDems])
)
def test_a_slot_is_that_of_a_queue_looked_through(
    draw: random.Random, kind: type[EdgeCloudEdf]
) -> None:
    """Whatever was put in and taken out before, and however the share of the edge changed."""
    scheduler = kind()
    scheduler.start(Resources(), 0)
    now = 0
    for number in range(40):
        now += draw.randrange(40) * MS
        task = Task(number, profile(draw.choice([20, 50, 90])), now, now + draw.randrange(900) * MS)
        place, finish = scheduler.slot(task, now)
        assert place == bisect_right(
            [scheduler.key(one) for one in scheduler.queue], scheduler.key(task)
        )
        ahead = sum(scheduler.occupied(one) for one in [*scheduler.queue[:place], task])
        assert finish == max(scheduler.free_at, now) + ahead
        list(scheduler.task_arrived(task, now))
        if draw.random() < 0.3:
            list(scheduler.executor_idle(now))
        if isinstance(scheduler, _TenantDems) and draw.random() < 0.2:
            scheduler.take_share(draw.choice([0.25, 0.5, 1.0]))


@given(st.lists(st.tuples(st.integers(1, 900), st.booleans()), max_size=40))
def test_an_estimate_is_the_mean_of_its_window(times: list[tuple[int, bool]]) -> None:
    """Of ten; a probe fills all of it."""
    estimate, window, expected = _Estimate(300 * MS), deque[int](maxlen=WINDOW), 300 * MS
    for ms, is_probe in times:
        if is_probe:
            estimate.refill(ms * MS)
            window.extend([ms * MS] * WINDOW)
            expected = ms * MS
        else:
            estimate.observe(ms * MS)
            window.append(ms * MS)
            mean = sum(window) // len(window)
            if len(window) == WINDOW and abs(mean - expected) > TOLERANCE:
                expected = mean
        assert estimate.cloud_time == expected


class _PlainGems(Gems):
    """Counts anew which tasks ended in the present window, each time that it looks at one."""

    def __init__(self) -> None:
        super().__init__()
        self.ends: list[tuple[int, str, bool]] = []

    def _count(self, task: Task, now: int, *, done: bool) -> None:
        self.ends.append((now, task.profile.model, done))
        self._changed = True

    def _in_danger(self, task: Task, now: int) -> bool:
        profile = task.profile
        assert profile.qoe is not None
        begun = now // profile.qoe.window * profile.qoe.window
        ends = [done for at, model, done in self.ends if at >= begun and model == profile.model]
        is_below = sum(ends) < profile.qoe.share * len(ends)
        fits = now + self.cloud_time(task) < task.deadline
        return is_below and fits and profile.cloud_gain > 0


@pytest.mark.parametrize("network", ["steady", "trapezium", "outage"])
def test_gems_rescues_whom_a_look_at_all_would(network: str) -> None:
    """Over 40 s, in which windows of the goal end."""
    load = Workload.named("5D-A", 40 * NANOSECONDS)
    wavering = Network.named(network, load.duration)
    path = SamplePath.draw(load, 0, 5, ExecutionTimes("lognormal", 0.3), wavering)
    traces = [simulate(path, scheduler(), record=True) for scheduler in (Gems, _PlainGems)]
    decided = [
        [(at, type(one), one.task.id, one.reason) for at, one in trace.decisions]
        for trace in traces
    ]
    assert decided[0] == decided[1]
    assert any(reason == MIGRATED for *_, reason in decided[0])


@given(
    st.lists(
        st.tuples(st.integers(0, 4), st.sampled_from([0.5, 1.0, 3.0]), st.booleans()),
        min_size=1,
        max_size=4,
    ),
    st.integers(0, 9),
)
def test_a_slot_is_kept_for_each_other_tenant_below_its_share(
    tenants: list[tuple[int, float, bool]], slots: int
) -> None:
    """By the rule written out, with in cloud, weight and whether it is active of each tenant."""
    scheduler = SfqDems()
    scheduler.start(Resources(slots), 0)
    now = 60 * NANOSECONDS
    for number, (in_cloud, weight, is_active) in enumerate(tenants):
        one = _Tenant(_TenantDems(), weight, now if is_active else 0, in_cloud)
        scheduler._tenants[str(number)] = one
        scheduler._in_cloud += in_cloud
    whole = sum(weight for _, weight, is_active in tenants if is_active)
    below = [in_cloud < slots * weight / max(whole, weight) for in_cloud, weight, _ in tenants]
    active = sum(is_active for *_, is_active in tenants)
    free = slots - sum(in_cloud for in_cloud, *_ in tenants)
    for number in range(len(tenants)):
        others = [
            is_below
            for other, (is_below, (*_, is_active)) in enumerate(zip(below, tenants, strict=True))
            if other != number and is_active and is_below
        ]
        kept = 0 if below[number] or slots <= active else len(others)
        assert scheduler._may_send(str(number), now) == (free > kept)


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 50), st.booleans()), max_size=30))
def test_windows_count_many_tasks_as_one_by_one(arrivals: list[tuple[int, int, bool]]) -> None:
    """Also a model without a goal, and none at all."""
    kinds = [
        Profile(f"m{number}", 10, 100, 10, 20, qoe=QoeGoal(number, 0.5, 10) if number else None)
        for number in range(4)
    ]
    tasks = [
        Task(number, kinds[kind], at, at + 100) for number, (kind, at, _) in enumerate(arrivals)
    ]
    done = [task for task, (_, _, in_time) in zip(tasks, arrivals, strict=True) if in_time]
    together, alone = QoeWindows(), QoeWindows()
    together.arrived(*tasks)
    together.done(*done)
    for task in tasks:
        alone.arrived(task)
    for task in done:
        alone.done(task)
    assert together.won == alone.won
    assert together.utility == alone.utility
