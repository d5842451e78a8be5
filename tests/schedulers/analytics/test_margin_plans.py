"""Plans of the edge where two of them are close, and when Margin lets a task leave."""

from __future__ import annotations

import pytest

from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    Profile,
    QoeGoal,
    Resources,
    SendToCloud,
    Task,
    WakeAt,
)
from aerodaas.schedulers.analytics.estimates import TimeEstimate
from aerodaas.schedulers.analytics.margin import Margin
from aerodaas.schedulers.analytics.planner import Job, JobQueue, plan

MS = MILLISECOND


def one(name: str, time: float, *, release: float = 0, deadline: float, benefit: float) -> JobQueue:
    """A lane of one job that takes `time` for certain."""
    return JobQueue(TimeEstimate(time, 1e-6), [Job(name, release, deadline, benefit, 0)])


def chosen(
    *lanes: JobQueue, until: float = 1000, price: float = 0.01, width: int = 8, gap: float = 50
) -> list[str]:
    """What a plan from 0 runs, in order."""
    return [job.what for _, _, job in plan(lanes, 0, until, price, width=width, gap=gap)]


@pytest.mark.parametrize(("gap", "first"), [(50, "dear"), (49, "cheap")])
def test_a_plan_may_wait_for_as_long_as_the_gap(gap: float, first: str) -> None:
    """What comes in 50 and must start at once is worth it, if 50 may be waited."""
    cheap = one("cheap", 100, deadline=1000, benefit=5)
    dear = one("dear", 100, release=50, deadline=151, benefit=100)
    assert chosen(cheap, dear, gap=gap)[0] == first


@pytest.mark.parametrize(("until", "count"), [(100, 1), (101, 2)])
def test_a_plan_ends_with_the_job_that_ends_at_its_horizon(until: float, count: int) -> None:
    """Of two jobs of 100, the first reaches 100 and not 101."""
    jobs = [Job(name, 0, 1000, 100, 0) for name in ("first", "second")]
    assert (
        chosen(JobQueue(TimeEstimate(100, 1e-6), jobs), until=until) == ["first", "second"][:count]
    )


def test_a_plan_without_alternatives_keeps_the_one_that_gains_most() -> None:
    """One plan is kept after each step: that of 100 in 10, not that of 10 in 50."""
    good = one("good", 10, deadline=11, benefit=100)
    long = one("long", 50, deadline=51, benefit=10)
    assert chosen(good, long, width=1) == ["good"]
    assert chosen(long, good, width=1) == ["good"]


@pytest.mark.parametrize(("now", "later"), [(100, 50), (50, 100)])
def test_of_two_orders_of_the_same_jobs_the_one_without_idle_time_is_taken(
    now: float, later: float
) -> None:
    """Ten each, one of them released at 30: done at 40 in one order, at 50 in the other."""
    here = one("here", 10, deadline=900, benefit=now)
    to_come = one("to come", 10, release=30, deadline=900, benefit=later)
    assert chosen(here, to_come) == ["here", "to come"]
    assert chosen(to_come, here) == ["here", "to come"]


@pytest.mark.parametrize(("benefit", "taken"), [(11, "short"), (13, "long")])
def test_idle_time_after_the_last_job_costs_half_of_the_price(benefit: float, taken: str) -> None:
    """To 1000 at 0.01, 100 and idleness cost 1 + 4.5, and 500 and idleness 5 + 2.5: 2 more."""
    short = one("short", 100, deadline=101, benefit=10)
    long = one("long", 500, deadline=501, benefit=benefit)
    assert chosen(short, long) == [taken]
    assert chosen(long, short) == [taken]


@pytest.mark.parametrize(("cost", "goal"), [(20.0, None), (110.0, QoeGoal(100.0, 1.0, 1000 * MS))])
def test_margin_lets_a_task_leave_three_standard_deviations_early(
    cost: float, goal: QoeGoal | None
) -> None:
    """Due at 600, it takes 300 ± 15.03 in the cloud, with 5 for each of two decisions.

    It has next to nothing to win by waiting: the edge takes 900. So it leaves at
    600 - 300 - 45.1 - 10 and may start up to one deviation late. A bonus of 100 that hangs on
    this task alone makes up for a loss of 10.
    """
    profile = Profile("m", 100, 600 * MS, 900 * MS, 300 * MS, 1, cost, goal)
    task = Task(1, profile, 0, profile.deadline)
    margin = Margin()
    margin.start(Resources(), 0)
    (wait,) = margin.task_arrived(task, 0)
    assert isinstance(wait, WakeAt)
    assert wait.at / MS == pytest.approx(244.9, abs=0.05)
    (sent,) = margin.timer(wait.at)
    assert isinstance(sent, SendToCloud)
    assert sent.reason == "worth more there"
    assert sent.latest_start is not None
    assert sent.latest_start / MS == pytest.approx(315.03, abs=0.01)
