"""SFQ-DEMS: shares kept by weight, nobody's loss by another's greed, and no idle edge."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    AnalyticsScheduler,
    Drop,
    Profile,
    Resources,
    Task,
    TaskOutcome,
    TaskPlace,
)
from aerodaas.schedulers.analytics.published.dems import MARGIN, Dems
from aerodaas.schedulers.analytics.sfq_dems import SfqDems
from aerodaas.schedulers.lab import Network, Workload
from aerodaas.schedulers.lab.network import ExecutionTimes
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import Trace, simulate

NO_CLOUD = Resources(cloud_slots=0)


def profile(tenant: str, edge: int, deadline: int, *, weight: float = 1.0) -> Profile:
    """An analysis of a tenant that the edge alone is worth; times in milliseconds."""
    times = (deadline * MILLISECOND, edge * MILLISECOND, 100 * MILLISECOND)
    return Profile(f"{tenant}.one", 10.0, *times, 1.0, 20.0, tenant=tenant, weight=weight)


def every(period: int, one: Profile, until: int, phase: int = 0) -> list[tuple[int, Profile]]:
    """Arrivals of a profile each `period` milliseconds."""
    return [(at, one) for at in range(phase, until, period)]


def run(
    scheduler: AnalyticsScheduler,
    arrivals: Iterable[tuple[int, Profile]],
    resources: Resources = NO_CLOUD,
) -> Trace:
    """Play tasks that arrive at these milliseconds and take their profile's times."""
    tasks = [
        Task(number, one, at * MILLISECOND, at * MILLISECOND + one.deadline)
        for number, (at, one) in enumerate(sorted(arrivals, key=lambda pair: pair[0]))
    ]
    edge = [task.profile.edge_time for task in tasks]
    cloud = [task.profile.cloud_time for task in tasks]
    return simulate(SamplePath(tasks, edge, cloud, Network()), scheduler, resources, record=True)


def done(trace: Trace, tenant: str) -> float:
    """Share of a tenant's tasks that finished in time."""
    own = [r.outcome is TaskOutcome.DONE for r in trace.results if r.task.profile.tenant == tenant]
    return sum(own) / len(own)


@pytest.mark.parametrize("slots", [0, 3, 32])
@pytest.mark.parametrize("name", ["2D-P", "4D-A"])
def test_with_one_tenant_it_is_dems(name: str, slots: int) -> None:
    """The same tasks end in the same way, with a cloud, with few slots, and without."""
    workload, resources = Workload.named(name, 20_000_000_000), Resources(cloud_slots=slots)
    times = ExecutionTimes.named("lognormal:0.15")
    path = SamplePath.draw(workload, 0, 3, times, Network())
    ours, dems = simulate(path, SfqDems(), resources), simulate(path, Dems(), resources)

    def ends(trace: Trace) -> list[tuple[int, str, str]]:
        return sorted((r.task.id, r.outcome.value, r.place.value) for r in trace.results)

    assert ends(ours) == ends(dems)


@settings(max_examples=60)
@given(
    edge=st.integers(20, 150),
    use=st.floats(0.3, 0.95),
    weight=st.sampled_from([0.5, 1.0, 3.0]),
    greedy_edge=st.integers(20, 150),
    greedy_deadline=st.integers(160, 2000),
    greedy_period=st.integers(10, 100),
    phase=st.integers(0, 300),
)
def test_a_tenant_below_its_share_loses_nothing_by_anothers_greed(
    edge: int,
    use: float,
    weight: float,
    greedy_edge: int,
    greedy_deadline: int,
    greedy_period: int,
    phase: int,
) -> None:
    """Whatever the other one asks for, all of its tasks are in time.

    Its deadlines leave room for the task's time on its share and for the server's delay by start-
    time fair queueing: nobody is interrupted.
    """
    share = weight / (1.0 + weight)
    period = round(edge / (share * use)) + 1
    modest = profile("modest", edge, round(edge / share) + 2 * greedy_edge + 20, weight=weight)
    greedy = profile("greedy", greedy_edge, greedy_deadline)
    arrivals = every(period, modest, 6000, phase) + every(greedy_period, greedy, 6000)
    assert done(run(SfqDems(), arrivals), "modest") == 1.0


def test_plain_dems_lets_the_greedy_one_take_everything() -> None:
    """The tenant that asks for a fifth of the edge loses most of it, and nothing when shared."""
    modest, greedy = profile("modest", 100, 420), profile("greedy", 100, 1000)
    arrivals = every(500, modest, 20_000) + every(20, greedy, 20_000)
    assert done(run(Dems(), arrivals), "modest") < 0.5
    assert done(run(SfqDems(), arrivals), "modest") == 1.0


@settings(max_examples=40)
@given(
    weights=st.tuples(st.integers(1, 5), st.integers(1, 5)),
    edges=st.tuples(st.integers(20, 120), st.integers(20, 120)),
)
def test_two_greedy_tenants_get_the_edge_by_their_weights(
    weights: tuple[int, int], edges: tuple[int, int]
) -> None:
    """Work over weight differs by no more than two tasks of each."""
    names = ("a", "b")
    models = [
        profile(name, edge, 3000, weight=weight)
        for name, edge, weight in zip(names, edges, weights, strict=True)
    ]
    trace = run(SfqDems(), [pair for one in models for pair in every(10, one, 6000)])
    ran = [r for r in trace.results if r.place is TaskPlace.EDGE and r.started > 500 * MILLISECOND]
    work = {
        name: sum(
            r.task.profile.edge_time / MILLISECOND / r.task.profile.weight
            for r in ran
            if r.task.profile.tenant == name and r.finished < 6000 * MILLISECOND
        )
        for name in names
    }
    bound = sum(edge / weight for edge, weight in zip(edges, weights, strict=True))
    assert abs(work["a"] - work["b"]) <= 2 * bound


@settings(max_examples=60)
@given(
    tenants=st.lists(
        st.tuples(st.integers(20, 200), st.integers(20, 1500), st.integers(30, 600)),
        min_size=1,
        max_size=4,
    )
)
def test_the_edge_is_never_idle_while_a_task_could_run(
    tenants: list[tuple[int, int, int]],
) -> None:
    """Whoever's task it is: one that never ran saw a busy edge until its latest start."""
    models = [
        (profile(f"t{number}", edge, edge + room), period)
        for number, (edge, room, period) in enumerate(tenants)
    ]
    trace = run(SfqDems(), [pair for one, period in models for pair in every(period, one, 3000)])
    busy = sorted((r.started, r.finished) for r in trace.results if r.place is TaskPlace.EDGE)
    for decided_at, decision in trace.decisions:
        if isinstance(decision, Drop):
            task = decision.task
            latest = min(decided_at, task.deadline - task.profile.edge_time - MARGIN)
            gaps = _gaps(busy, task.arrival, latest)
            assert not gaps, (task, gaps)


def _gaps(busy: list[tuple[int, int]], begin: int, end: int) -> list[tuple[int, int]]:
    """Times in which nothing ran, between two moments."""
    found, at = [], begin
    for start, finish in busy:
        if start > at and start <= end:
            found.append((at, start))
        at = max(at, finish)
        if at >= end:
            return found
    return [*found, (at, end)] if at < end else found


def test_a_modest_tenant_finds_a_slot_in_a_crowded_cloud() -> None:
    """The last slot is kept from the tenant above its share; plain DEMS has it all taken."""
    times = (400 * MILLISECOND, 500 * MILLISECOND, 300 * MILLISECOND)
    one = Profile("greedy.far", 50.0, *times, 1.0, 5.0, tenant="greedy")
    modest = replace(one, model="modest.far", tenant="modest")
    arrivals = every(20, one, 10_000) + every(700, modest, 10_000, 11)
    few = Resources(cloud_slots=4)
    assert done(run(Dems(), arrivals, few), "modest") < 0.7
    ours = run(SfqDems(), arrivals, few)
    assert done(ours, "modest") == 1.0
    # One of four slots is kept, and the modest one uses another for three tenths of the time.
    assert done(ours, "greedy") > 0.6 * done(run(Dems(), arrivals, few), "greedy")


def test_a_tenant_that_has_gone_gives_its_share_back() -> None:
    """Ten seconds after its last task the other one admits by the whole edge again."""
    gone, stays = profile("gone", 10, 1000), profile("stays", 60, 100)
    trace = run(SfqDems(), [(0, gone), *every(500, stays, 20_000)])
    assert done(trace, "stays") == 1.0
    reasons = [
        (at, decision.reason) for at, decision in trace.decisions if decision.task.profile is stays
    ]
    early = {reason for at, reason in reasons if at < 9_000 * MILLISECOND}
    late = {reason for at, reason in reasons if at > 11_000 * MILLISECOND}
    assert early == {"stolen back from the cloud"}
    assert late == {"first in the edge queue"}
