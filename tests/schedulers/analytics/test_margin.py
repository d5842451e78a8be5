"""The parts of the project's own scheduler, and what it does with them."""

from __future__ import annotations

import itertools
import random
from math import inf

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    Profile,
    QoeGoal,
    Resources,
    Result,
    Task,
    TaskOutcome,
    TaskPlace,
)
from aerodaas.schedulers.analytics.estimates import TimeEstimate, TimeEstimates, chance
from aerodaas.schedulers.analytics.forecast import Forecast
from aerodaas.schedulers.analytics.margin import Margin
from aerodaas.schedulers.analytics.outlook import CloudOutlook
from aerodaas.schedulers.analytics.planner import Job, JobQueue, plan
from aerodaas.schedulers.analytics.published.profiles import PUBLISHED
from aerodaas.schedulers.analytics.quality import QualityWatch
from aerodaas.schedulers.lab.network import Network
from aerodaas.testing.scheduler_kit import End, play

HV, MD, CD = PUBLISHED["HV"], PUBLISHED["MD"], PUBLISHED["CD"]


def test_beliefs_learn_mean_and_spread() -> None:
    """After 300 observations the belief is close to the distribution that they came from."""
    draw = random.Random(1)
    beliefs = TimeEstimates(shared=False)
    for number in range(300):
        taken = draw.gauss(200, 20) * MILLISECOND
        beliefs.observe(HV, int(taken), number * NANOSECONDS)
    belief = beliefs.belief(HV)
    assert belief.mean == pytest.approx(200 * MILLISECOND, rel=0.05)
    assert belief.sigma == pytest.approx(20 * MILLISECOND, rel=0.4)


def test_the_shared_delay_of_one_model_tells_about_the_others() -> None:
    """A network that adds 100 ms is learned from HV alone and believed of MD."""
    beliefs = TimeEstimates(shared=True)
    for number in range(60):
        taken = HV.cloud_time + 100 * MILLISECOND * (number >= 20)
        beliefs.observe(HV, taken, number * NANOSECONDS // 4)
    assert beliefs.belief(MD).mean == pytest.approx(
        MD.cloud_time + 100 * MILLISECOND, abs=15 * MILLISECOND
    )


@given(st.floats(1, 1000), st.floats(0.1, 100), st.floats(-2000, 2000), st.floats(0, 500))
def test_chance_is_a_distribution(mean: float, sigma: float, room: float, more: float) -> None:
    """Between 0 and 1, a half at the mean, never falling with the room."""
    belief = TimeEstimate(mean, sigma)
    assert 0 <= chance(belief, room) <= chance(belief, room + more) <= 1
    assert chance(belief, mean) == pytest.approx(0.5)


def test_periodic_arrivals_are_forecast_after_three_gaps() -> None:
    """A stream that breaks its rhythm is no longer believed."""
    forecast = Forecast()
    seen = [forecast.arrived("drone", at) for at in (0, 100, 200, 300, 400)]
    assert seen == [False, False, False, False, True]
    assert list(forecast.due(400, 10_000)) == [(500, "drone")]
    assert not forecast.arrived("drone", 450)
    assert list(forecast.due(450, 10_000)) == []


def _best_by_enumeration(lanes: list[JobQueue], price: float, until: float) -> float:
    """Best merit over all sequences that respect the lanes' order, by brute force."""
    jobs = [(lane, job) for lane in lanes for job in lane.jobs]
    best = -inf
    for count in range(1, len(jobs) + 1):
        for order in itertools.permutations(jobs, count):
            free = merit = 0.0
            for lane, job in order:
                begin = max(free, job.release)
                if begin + lane.time.mean > job.deadline:
                    break
                merit += job.benefit - job.loss - price * (begin + lane.time.mean - free)
                free = begin + lane.time.mean
            else:
                best = max(best, merit - price * 0.5 * max(until - free, 0.0))
    return best


@settings(max_examples=40)
@given(
    st.lists(
        st.tuples(st.integers(10, 60), st.integers(0, 80), st.integers(1, 90)),
        min_size=1,
        max_size=4,
    ),
    st.floats(0, 1),
)
@example(jobs=[(10, 10, 1), (60, 0, 1), (60, 0, 1), (60, 11, 2)], price=0.0)
def test_a_wide_beam_finds_the_best_plan(jobs: list[tuple[int, int, int]], price: float) -> None:
    """One job per lane, certain times: as good as the best of all orders."""
    lanes = [
        JobQueue(TimeEstimate(length, 1e-6), [Job(number, release, 200.0, gain, 0.0)])
        for number, (length, release, gain) in enumerate(jobs)
    ]
    steps = plan(lanes, 0.0, 1000.0, price, width=1000, gap=1000.0)
    free = merit = 0.0
    for begin, lane, job in steps:
        assert begin >= max(free, job.release)
        assert begin + lane.time.mean <= job.deadline
        merit += job.benefit - job.loss - price * (begin + lane.time.mean - free)
        free = begin + lane.time.mean
    # Plans that no job can lengthen are the only ones compared, as an idle edge gains nothing.
    assert merit - price * 0.5 * (1000 - free) <= _best_by_enumeration(lanes, price, 1000) + 1e-6
    if price == 0:
        assert merit == pytest.approx(_best_by_enumeration(lanes, 0.0, 1000))


def test_a_plan_waits_for_a_better_job_only_if_the_gap_allows() -> None:
    """A long cheap job now, or a dear one that arrives in 50 and must start at once."""
    cheap = JobQueue(TimeEstimate(100, 1e-6), [Job("cheap", 0, 1000, 5, 0)])
    dear = JobQueue(TimeEstimate(100, 1e-6), [Job("dear", 50, 150, 100, 0)])
    patient = plan([cheap, dear], 0, 300, 0.01, width=8, gap=60)
    assert [job.what for _, _, job in patient] == ["dear", "cheap"]
    assert patient[0][0] == 50
    hasty = plan([cheap, dear], 0, 300, 0.01, width=8, gap=40)
    assert [job.what for _, _, job in hasty] == ["cheap"]


def test_quality_is_worth_most_in_the_balance() -> None:
    """Nothing once the bonus is safe or lost; much when one success decides."""
    watch = QualityWatch(QoeGoal(100, 0.9, 1000))
    for at in range(10):
        watch.arrival(at)
    watch.success = 0.5
    for at in range(8):
        watch.ended(at, in_time=True)
    in_balance = watch.worth()
    watch.ended(8, in_time=True)
    assert in_balance > 20
    assert watch.worth() == 0
    lost = QualityWatch(QoeGoal(100, 0.9, 1000))
    for at in range(10):
        lost.arrival(at)
    for at in range(2):
        lost.ended(at, in_time=False)
    assert lost.worth() == 0


def _outlook(slots: int = 32) -> CloudOutlook:
    outlook = CloudOutlook()
    outlook.resources = Resources(cloud_slots=slots)
    return outlook


def _task(number: int, profile: Profile = HV) -> Task:
    return Task(number, profile, 0, profile.deadline)


def test_the_cloud_is_worth_its_chance() -> None:
    """The full gain with ample room, nothing without, never below zero."""
    outlook = _outlook()
    assert outlook.value(HV, HV.deadline) == pytest.approx(100, abs=0.5)
    assert outlook.value(HV, HV.cloud_time // 2) == 0
    assert outlook.value(PUBLISHED["BP"], NANOSECONDS) == 0
    assert outlook.value(PUBLISHED["BP"], NANOSECONDS, bonus=13) == pytest.approx(10, abs=0.5)


def test_waiting_pays_less_the_less_it_can_win() -> None:
    """Patience ends earlier (at more room) where little or nothing can be won by waiting."""
    outlook = _outlook()
    rates = [1e-9 * worth for worth in (0.1, 1, 10, 100)]
    rooms = [outlook.patience(HV, 1.0, rate) for rate in rates]
    assert rooms == sorted(rooms, reverse=True)
    assert rooms[0] > rooms[-1]


def test_a_silent_cloud_is_avoided_until_it_answers() -> None:
    """Two overdue answers in a row silence it; an answer to a later question revives it."""
    outlook = _outlook()
    for number in range(3):
        outlook.sent(_task(number), number)
    outlook.listen(300 * MILLISECOND)
    assert outlook.value(HV, HV.deadline) > 90
    outlook.listen(800 * MILLISECOND)
    assert outlook.silent_since == 800 * MILLISECOND
    assert outlook.value(HV, HV.deadline) == 0
    probe = _task(9)
    sent, back = 1900 * MILLISECOND, 2300 * MILLISECOND
    assert outlook.wants_probe(sent)
    outlook.sent(probe, sent)
    outlook.finished(Result(probe, TaskOutcome.DONE, TaskPlace.CLOUD, sent, back), back)
    assert outlook.value(HV, HV.deadline) > 90


def test_crowded_slots_go_to_the_best() -> None:
    """HV wants 3 of 4 slots and MD 3 more: MD sets the price and stays out of the last slots."""
    outlook = _outlook(slots=4)
    density = {p.model: p.cloud_gain / p.cloud_time for p in (HV, MD)}
    outlook.set_slot_price([(density["MD"], 3.0), (density["HV"], 3.0)])
    assert outlook.slot_price == density["MD"]
    assert outlook.value(MD, MD.deadline) > 0
    for number in range(4):
        outlook.sent(_task(number), 0)
    assert outlook.value(MD, MD.deadline) == 0
    assert outlook.value(HV, HV.deadline + NANOSECONDS) > 0


def test_margin_does_not_pay_for_what_is_likely_to_fail() -> None:
    """CD takes 878 of 1000 in the cloud and gains 23: with a spread of 30 %, it is not sent."""
    draw = random.Random(3)
    tasks = [(200.0 * number, HV) for number in range(200)]
    tasks += [(40_000 + 700.0 * number, CD) for number in range(20)]
    factors = [max(0.1, draw.gauss(1, 0.3)) for _ in tasks]
    blocked = [
        (factor * p.edge_time / MILLISECOND, factor * p.cloud_time / MILLISECOND)
        for factor, (_, p) in zip(factors, tasks, strict=True)
    ]
    ends = play(
        Margin(), tasks, edge_ms=[edge for edge, _ in blocked], cloud_ms=[c for _, c in blocked]
    )
    assert "cloud" not in {end.place for end in ends[-20:]}


def test_margin_defers_a_task_and_takes_it_back() -> None:
    """HV waits for the edge; it leaves when waiting no longer pays, or runs if that is free."""
    left = play(Margin(), [(0, CD), (1, HV)])[1]
    assert (left.place, left.outcome) == ("cloud", "done")
    assert left.started > 100
    stolen = play(Margin(), [(0, CD), (1, HV)], edge_ms=[100, 174])[1]
    assert stolen == End("edge", "done", 100, 274)


def test_margin_probes_a_cloud_that_is_away() -> None:
    """During an outage of 20 s at most one task a second is risked once it was noticed."""
    network = Network(outages=((5 * NANOSECONDS, 25 * NANOSECONDS),))
    tasks = sorted(
        ((100 + 1000 * second + 7 * lane, profile) for second in range(30)
         for lane, profile in enumerate([HV, MD] * 6)),
        key=lambda pair: pair[0],
    )  # fmt: skip
    ends = play(Margin(), tasks, network=network)
    risked = [end for end in ends if end.place == "cloud" and 7000 < end.started < 24_900]
    assert 10 <= len(risked) <= 20
    assert any(end == End("cloud", "done", *end[2:]) for end in ends if end.started > 26_000)
