"""What Margin reckons with, worked by hand: estimates, bonuses, the cloud's worth, and plans."""

from __future__ import annotations

from math import comb
from statistics import NormalDist

import pytest

from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    STOLEN,
    Profile,
    QoeGoal,
    Resources,
    Result,
    RunOnEdge,
    Task,
    TaskOutcome,
    TaskPlace,
)
from aerodaas.schedulers.analytics.estimates import TimeEstimate, TimeEstimates
from aerodaas.schedulers.analytics.forecast import Forecast
from aerodaas.schedulers.analytics.margin import Margin
from aerodaas.schedulers.analytics.outlook import CloudOutlook
from aerodaas.schedulers.analytics.planner import Job, JobQueue, plan
from aerodaas.schedulers.analytics.published.cloud_only import CloudOnly
from aerodaas.schedulers.analytics.quality import QualityWatch
from aerodaas.testing.scheduler_kit import play

MS = MILLISECOND
M = Profile("m", 100, 1000 * MS, 200 * MS, 200 * MS, 1, 20)
"""200 ms on the edge and in the cloud."""


@pytest.mark.parametrize("shared", [False, True])
def test_a_belief_begins_at_the_profile(shared: bool) -> None:  # noqa: FBT001
    """Its mean exactly, and a standard deviation of 5 % with 1 ms more in squares."""
    belief = TimeEstimates(shared=shared).belief(M)
    assert belief.mean == 200 * MS
    assert belief.sigma == pytest.approx((10**2 + 1) ** 0.5 * MS)


def test_the_profile_counts_for_five_observations() -> None:
    """The first of 260 moves the mean by a sixth of 60, the second by a seventh of the rest."""
    beliefs = TimeEstimates(shared=False)
    means = []
    for number in range(3):
        means.append(beliefs.belief(M).mean / MS)
        beliefs.observe(M, 260 * MS, number)
    assert means == pytest.approx([200, 210, 210 + 50 / 7])


def test_a_late_answer_is_shared_out_between_the_network_and_the_model() -> None:
    """After 1 s the network's delay may be off by 15, a model of 200 by 10: 225 to 100 in squares.

    Of 60 too many, 9/13 are the network's, for every model; a sixth of the rest is the model's.
    """
    beliefs = TimeEstimates(shared=True)
    other = Profile("other", 100, 1000 * MS, 200 * MS, 400 * MS, 1, 20)
    assert beliefs.belief(M).mean == 200 * MS
    assert beliefs.belief(other).mean == 400 * MS
    beliefs.observe(M, 260 * MS, 1000 * MS)
    assert beliefs.delay / MS == pytest.approx(60 * 9 / 13)
    assert beliefs.belief(other).mean / MS == pytest.approx(400 + 60 * 9 / 13)
    assert beliefs.belief(M).mean / MS == pytest.approx(200 + 60 * 9 / 13 + 60 * 4 / 13 / 6)


def test_estimates_never_stop_following() -> None:
    """After a thousand of 200, one of 300 still moves the mean by 2."""
    beliefs = TimeEstimates(shared=False)
    for number in range(1000):
        beliefs.observe(M, 200 * MS, number)
    beliefs.observe(M, 300 * MS, 1000)
    assert beliefs.belief(M).mean / MS == pytest.approx(202)


def test_the_fourth_regular_arrival_is_the_first_to_be_forecast_from() -> None:
    """Of arrivals every 100, the third gap makes three that agree."""
    forecast = Forecast()
    forecasts = []
    for at in (0, 100, 200, 300):
        forecast.arrived("drone", at)
        forecasts.append(list(forecast.due(at, 10_000)))
    assert forecasts == [[], [], [], [(400, "drone")]]


@pytest.mark.parametrize("cost", ["edge_cost", "cloud_cost"])
@pytest.mark.parametrize("value", [-0.1, float("inf"), float("nan")])
def test_costs_that_cannot_be_are_refused(cost: str, value: float) -> None:
    """The message names the model and the cost."""
    with pytest.raises(SchedulerError, match=f"'m': {cost} must not be negative"):
        Profile("m", 100, 10, 1, 1, *((value, 0) if cost == "edge_cost" else (0, value)))


def test_a_small_gain_and_a_short_time_out_are_allowed() -> None:
    """Half a unit on one of the two, and a nanosecond; a gain of nothing on both is not."""
    assert Profile("m", 100, 10, 1, 1, 99.5, 200).edge_gain == 0.5
    assert Resources(cloud_timeout=1).cloud_timeout == 1
    with pytest.raises(SchedulerError, match="would never run"):
        Profile("m", 100, 10, 1, 1, 100, 100)


def test_no_more_tasks_than_slots_are_in_the_cloud_at_once() -> None:
    """Of five at once in two slots, the last starts third."""
    ends = play(CloudOnly(), [(0, M)] * 5, resources=Resources(cloud_slots=2))
    assert [end.started for end in ends] == [0, 0, 200, 200, 400]


def watch(total: int, done: int, missed: int, success: float = 0.9) -> QualityWatch:
    """A window of 1000 with these counts, 90 % of which must be in time for a bonus of 100."""
    counting = QualityWatch(QoeGoal(100, 0.9, 1000))
    for at in range(total):
        counting.arrival(at)
    for at in range(done + missed):
        counting.ended(at, in_time=at < done)
    counting.success = success
    return counting


@pytest.mark.parametrize(
    ("total", "done", "missed", "success"),
    [
        (20, 8, 1, 0.9),
        (20, 17, 0, 0.6),
        (40, 20, 2, 0.9),
        (40, 22, 2, 0.95),
        (40, 30, 2, 0.7),
        (100, 40, 5, 0.9),
        (100, 80, 9, 0.9),
    ],
)
def test_a_success_is_worth_the_chance_that_it_decides(
    total: int, done: int, missed: int, success: float
) -> None:
    """It decides if of the others exactly one fewer succeeds than are needed: binomial."""
    others, needed = total - done - missed - 1, round(0.9 * total) - done
    k = needed - 1
    exact = comb(others, k) * success**k * (1 - success) ** (others - k)
    assert watch(total, done, missed, success).worth() == pytest.approx(100 * exact, abs=6)


def test_where_all_the_rest_must_succeed_each_is_worth_much() -> None:
    """Ten, eight in time, one missed: the last decides. With two missed, nothing does any more."""
    assert watch(10, 8, 1).worth() > 60
    assert watch(10, 7, 1).worth() > 60
    assert watch(10, 8, 2).worth() == 0
    assert watch(10, 9, 0).worth() == 0


def test_a_window_is_forecast_from_the_one_before() -> None:
    """One arrival after ten just before is taken for the first of ten; after a pause it is not."""
    after_ten = watch(10, 9, 1)
    after_ten.arrival(1000)
    assert after_ten.worth() == pytest.approx(100 * 9 * 0.9**8 * 0.1, abs=6)
    after_pause = watch(10, 9, 1)
    after_pause.arrival(2000)
    assert after_pause.worth() > 60


def test_what_ends_in_a_later_window_counts_for_the_rate_of_success_alone() -> None:
    """The rate moves by 5 % of the way: 0.9, 0.855, 0.86225."""
    one = QualityWatch(QoeGoal(100, 0.9, 1000))
    one.arrival(0)
    one.arrival(1000)
    one.ended(0, in_time=False)
    assert one.success == pytest.approx(0.855)
    one.ended(1000, in_time=True)
    assert one.success == pytest.approx(0.86225)
    assert (one.done, one.missed) == (1, 0)


def test_without_a_bonus_a_success_is_worth_no_more() -> None:
    """A goal may be counted without being paid for."""
    plain = QualityWatch(QoeGoal(0, 0.9, 1000))
    plain.arrival(0)
    assert plain.worth() == 0


def outlook(slots: int, under_way: int = 0) -> CloudOutlook:
    """A cloud of `slots` that was sent tasks of M at 0, 1, … nanoseconds."""
    cloud = CloudOutlook()
    cloud.resources = Resources(cloud_slots=slots)
    for number in range(under_way):
        cloud.sent(Task(number, M, 0, M.deadline), number)
    return cloud


def test_a_task_that_must_wait_for_a_slot_needs_more_room() -> None:
    """Behind two in two slots half of 200, behind three all of it; 250 is enough without."""
    for under_way, wait in ((0, 0), (1, 0), (2, 100), (3, 200)):
        cloud = outlook(2, under_way)
        assert cloud.value(M, (250 + wait) * MS) > 79
        assert cloud.value(M, (205 + wait) * MS) == pytest.approx(100 * 0.5 - 20, abs=1)


@pytest.mark.parametrize("rate", [6e-8, 1e-7, 3e-7, 6e-7])
def test_waiting_ends_where_it_wins_as_much_as_it_loses(rate: float) -> None:
    """Where the density of the cloud's time at the room left, times the benefit, is the rate."""
    cloud = outlook(32)
    belief = cloud.beliefs.belief(M)
    room = cloud.patience(M, 1.0, rate) - 10 * MS
    density = NormalDist(belief.mean, belief.sigma).pdf(room)
    assert 1.0 < (room - belief.mean) / belief.sigma < 3.0
    assert 100 * density == pytest.approx(rate)


@pytest.mark.parametrize(("worth", "deviations"), [(1.0, 1.0), (1e-6, 3.0), (0.0, 3.0)])
def test_waiting_ends_one_to_three_standard_deviations_early(
    worth: float, deviations: float
) -> None:
    """One where much can be won, three where next to nothing can, or nothing."""
    cloud = outlook(32)
    belief = cloud.beliefs.belief(M)
    room = cloud.patience(M, worth, 1e-3) - 10 * MS
    assert (room - belief.mean) / belief.sigma == pytest.approx(deviations)


def test_a_start_in_the_cloud_may_count_on_one_standard_deviation() -> None:
    """A task of 200 ± 10.05 due at 1000 may start until 810.05."""
    started = outlook(32).latest_start(Task(1, M, 0, M.deadline))
    assert started / MS == pytest.approx(810.05, abs=0.01)


def test_two_overdue_answers_make_a_silence_and_one_does_not() -> None:
    """Overdue is three standard deviations and 50 ms beyond the mean."""
    overdue = 200 * MS + 3 * (10**2 + 1) ** 0.5 * MS + 50 * MS
    lonely, pair = outlook(32, 1), outlook(32, 2)
    lonely.listen(round(overdue + 2 * MS))
    assert lonely.silent_since is None
    pair.listen(round(overdue - MS))
    assert pair.silent_since is None
    began = round(overdue + MS)
    pair.listen(began)
    assert pair.silent_since == began
    pair.listen(began + 100 * MS)
    assert pair.silent_since == began


def test_an_answer_to_a_question_from_before_the_silence_does_not_end_it() -> None:
    """It says only how the cloud was; one to a question as old as the silence ends it."""
    cloud = outlook(32, 3)
    began = 400 * MS
    cloud.listen(began)
    for sent, ends in ((began - 1, False), (began, True)):
        task = Task(sent, M, 0, M.deadline)
        cloud.sent(task, sent)
        back = sent + 200 * MS
        cloud.finished(Result(task, TaskOutcome.DONE, TaskPlace.CLOUD, sent, back), back)
        assert (cloud.silent_since is None) == ends


def chosen(*lanes: JobQueue, start: float = 0.0, until: float = 1000.0) -> list[str]:
    """What a plan runs, in order, with a price of 0.01 for each moment."""
    steps = plan(lanes, start, until, 0.01, width=16, gap=50)
    return [job.what for _, _, job in steps]


@pytest.mark.parametrize(("deadline", "runs"), [(79.0, False), (81.0, True)])
def test_a_plan_passes_over_what_would_have_to_be_early(
    deadline: float,
    runs: bool,  # noqa: FBT001
) -> None:
    """A job of 100, give or take 20, is not tried where it must take less than 80."""
    lane = JobQueue(TimeEstimate(100, 20), [Job("job", 0, deadline, 100, 0)])
    assert chosen(lane) == (["job"] if runs else [])


def test_a_plan_counts_the_chance_from_where_a_job_begins() -> None:
    """Begun at 100 and due at 190, a job of 100 ± 20 has 31 % of 100, less than its loss of 50."""
    lane = JobQueue(TimeEstimate(100, 20), [Job("job", 0, 190, 100, 50)])
    assert chosen(lane, start=100) == []
    assert chosen(lane, start=50) == ["job"]


def test_a_plan_runs_nothing_for_nothing() -> None:
    """A loss of the benefit gains nothing, for certain."""
    assert chosen(JobQueue(TimeEstimate(100, 1e-6), [Job("job", 0, 500, 100, 100)])) == []
    assert chosen(JobQueue(TimeEstimate(100, 1e-6), [Job("job", 0, 500, 100, 99)])) == ["job"]


def test_a_plan_prefers_a_quick_gain_to_a_long_small_one() -> None:
    """Each must start at once, so one of the two is lost."""
    quick = JobQueue(TimeEstimate(10, 1e-6), [Job("quick", 0, 11, 100, 0)])
    long = JobQueue(TimeEstimate(200, 1e-6), [Job("long", 0, 201, 5, 0)])
    assert chosen(quick, long) == ["quick"]
    assert chosen(long, quick) == ["quick"]


def test_a_plan_takes_a_lane_s_jobs_in_their_order_and_passes_over_the_hopeless() -> None:
    """The first of three is past its deadline; the others follow each other."""
    jobs = [Job("past", 0, 50, 100, 0), Job("next", 0, 150, 100, 0), Job("last", 0, 250, 100, 0)]
    assert chosen(JobQueue(TimeEstimate(100, 1e-6), jobs)) == ["next", "last"]


@pytest.mark.parametrize(("under_way", "wait"), [(1, 0), (2, 100), (4, 300)])
def test_the_wait_for_a_slot_shortens_patience_and_excuses_answers(
    under_way: int, wait: int
) -> None:
    """A task must leave so much earlier, and an answer is overdue only so much later."""
    free, busy = outlook(2), outlook(2, under_way)
    longer = busy.patience(M, 0.0, 1e-3) - free.patience(M, 0.0, 1e-3)
    assert longer / MS == pytest.approx(wait)
    overdue = (200 + 3 * (10**2 + 1) ** 0.5 + 50 + wait) * MS
    waiting = outlook(2, max(under_way, 2))
    if under_way > 1:
        waiting.listen(round(overdue - MS))
        assert waiting.silent_since is None
        waiting.listen(round(overdue + MS))
        assert waiting.silent_since is not None


@pytest.mark.parametrize(
    ("place", "outcome"),
    [
        (TaskPlace.NOWHERE, TaskOutcome.DROPPED),
        (TaskPlace.CLOUD, TaskOutcome.FAILED),
        (TaskPlace.CLOUD, TaskOutcome.TIMEOUT),
    ],
)
def test_what_never_came_back_teaches_nothing(place: TaskPlace, outcome: TaskOutcome) -> None:
    """Neither how long the cloud takes nor that it is there again; its slot is free, though."""
    cloud = outlook(2, 3)
    cloud.listen(900 * MS)
    assert cloud.silent_since is not None
    task = Task(9, M, 0, M.deadline)
    cloud.sent(task, 901 * MS)
    cloud.finished(Result(task, outcome, place, 901 * MS, 990 * MS), 990 * MS)
    assert cloud.silent_since is not None
    assert cloud.beliefs.belief(M).mean == 200 * MS
    assert cloud.patience(M, 0.0, 1e-3) == outlook(2, 3).patience(M, 0.0, 1e-3)


def test_a_probe_is_due_a_second_after_the_last_task() -> None:
    """At exactly a second; never where there is no cloud."""
    cloud = outlook(2, 1)
    assert not cloud.wants_probe(1000 * MS - 1)
    assert cloud.wants_probe(1000 * MS)
    assert not outlook(0).wants_probe(5000 * MS)


@pytest.mark.parametrize(("slots", "priced"), [(4, True), (5, False)])
def test_slots_have_a_price_where_what_arrives_needs_more(slots: int, priced: bool) -> None:  # noqa: FBT001
    """20 a second of 200 ms need four slots; a tenth is kept free, so that five do and four don't.

    The price is what the model gains there for each nanosecond.
    """
    scheduler = Margin()
    scheduler.start(Resources(cloud_slots=slots), 0)
    for number in range(100):
        at = number * 50 * MS
        task = Task(number, M, at, at + M.deadline)
        list(scheduler.task_arrived(task, at))
        list(scheduler.executor_idle(at))
    expected = 80 / (200 * MS) if priced else 0.0
    assert scheduler.cloud.slot_price == pytest.approx(expected, rel=0.2)


def test_margin_reckons_with_the_time_that_is_left_and_not_with_the_clock() -> None:
    """A task that the cloud cannot do in time runs on the edge, at the start as after 10 s."""
    quick = Profile("quick", 100, 100 * MS, 50 * MS, 200 * MS, 30, 1)
    cheapest = Profile("cheapest", 100, 1000 * MS, 50 * MS, 200 * MS, 30, 0)
    for at in (300, 10_000):
        _, end = play(Margin(), [(0, cheapest), (at, quick)])
        assert (end.place, end.outcome) == ("edge", "done")


def test_margin_keeps_the_edge_free_for_what_is_about_to_come() -> None:
    """A regular task of great worth is waited for; a small one would be in its way."""
    great = Profile("great", 1000, 120 * MS, 100 * MS, 100 * MS)
    small = Profile("small", 5, 1000 * MS, 200 * MS, 200 * MS)
    tasks = [(300.0 * number, great) for number in range(5)]
    tasks.insert(4, (1150.0, small))
    ends = play(Margin(), tasks, resources=Resources(cloud_slots=0))
    assert [end.outcome for end in ends] == ["done"] * 6
    assert ends[5].started == 1200
    assert ends[4].started >= 1300


@pytest.mark.parametrize("cloud_cost", [20, 100])
def test_margin_says_what_it_takes_from_the_cloud(cloud_cost: int) -> None:
    """A task that pays there is stolen; one that does not is simply the best there is."""
    scheduler = Margin()
    scheduler.start(Resources(), 0)
    task = Task(0, Profile("m", 100, 1000 * MS, 200 * MS, 200 * MS, 1, cloud_cost), 0, 1000 * MS)
    list(scheduler.task_arrived(task, 0))
    (decision,) = scheduler.executor_idle(0)
    expected = STOLEN if cloud_cost == 20 else "most valuable plan"
    assert isinstance(decision, RunOnEdge)
    assert decision.reason == expected
