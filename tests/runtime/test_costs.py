"""What nodes cost is learnt from what was observed, odd values apart."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Header
from aerodaas.runtime.dispatch.costs import (
    DeadlineReserve,
    Estimates,
    ExecutionEstimates,
    LinkEstimate,
    Uplink,
    quantile,
)
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile

TIMES = frozenset({"edge_time", "cloud_time"})


@given(st.lists(st.floats(0, 1e6), min_size=1, max_size=50), st.floats(0.01, 1.0))
def test_a_quantile_is_one_of_the_values_that_enough_do_not_exceed(
    values: list[float], share: float
) -> None:
    """And no smaller one is."""
    found = quantile(values, share)
    assert found in values
    assert sum(value <= found for value in values) >= share * len(values) - 1e-9
    smaller = [value for value in values if value < found]
    assert len(smaller) < share * len(values) + 1e-9


@given(st.floats(1e-4, 1.0), st.floats(1e4, 1e9), st.lists(st.integers(20_000, 10**7), min_size=1))
def test_a_link_is_known_by_what_it_carried(
    latency: float, bandwidth: float, sizes: list[int]
) -> None:
    """Latency and bandwidth are recovered, and predict any other size."""
    link = LinkEstimate()
    link.observe(0, latency)
    for size in sizes:
        link.observe(size, latency + size / bandwidth)
    assert link.latency == pytest.approx(latency)
    assert link.seconds(123_456) == pytest.approx(latency + 123_456 / bandwidth, rel=0.02, abs=1e-6)


def test_a_link_of_which_nothing_is_known_is_taken_for_free() -> None:
    """So that the first frame goes, and tells."""
    assert LinkEstimate().seconds(1e6) == 0.0


def test_a_link_is_not_misled_by_one_stall_but_follows_a_change() -> None:
    """The median of a few."""
    link = LinkEstimate()
    for _ in range(10):
        link.observe(0, 0.02)
        link.observe(100_000, 0.03)
    usual = link.seconds(100_000)
    link.observe(0, 3.0)
    link.observe(100_000, 5.0)
    assert link.seconds(100_000) == pytest.approx(usual)
    for _ in range(6):
        link.observe(0, 0.4)
        link.observe(100_000, 0.5)
    assert link.seconds(100_000) == pytest.approx(0.5)


def test_an_execution_time_is_one_to_count_on() -> None:
    """High, but not the worst that was ever seen."""
    seen = ExecutionEstimates()
    assert seen.seconds("model") is None
    for milliseconds in (10, 10, 10, 11, 12, 10, 10, 10, 11, 12, 500):
        seen.observe("model", milliseconds / 1e3)
    assert seen.seconds("model") == pytest.approx(0.012)
    assert seen.seconds("other") is None


def told() -> Profile:
    """What the user, or nobody, said."""
    return Profile("model", 1.0, 1000 * MILLISECOND, 100 * MILLISECOND, 300 * MILLISECOND)


def test_what_the_user_left_out_is_measured_and_the_rest_stays() -> None:
    """In mission time, at whatever speed."""
    estimates = Estimates(2.0, frozenset())
    assert estimates.profile(told(), TIMES, None) == told()
    estimates.edge.observe("model", 0.04)
    found = estimates.profile(told(), frozenset({"edge_time"}), 0.05)
    assert (found.edge_time, found.cloud_time) == (80 * MILLISECOND, 300 * MILLISECOND)
    found = estimates.profile(told(), TIMES, 0.05)
    assert (found.edge_time, found.cloud_time) == (80 * MILLISECOND, 100 * MILLISECOND)


def test_what_a_scheduler_learns_by_itself_is_not_corrected_twice() -> None:
    """DEMS-A follows the cloud on its own, so only the edge's time is told."""
    estimates = Estimates(1.0, frozenset({"cloud_time"}))
    estimates.edge.observe("model", 0.02)
    found = estimates.profile(told(), TIMES, 0.9)
    assert (found.edge_time, found.cloud_time) == (20 * MILLISECOND, 300 * MILLISECOND)


def test_noise_makes_no_new_profile() -> None:
    """A scheduler may tell profiles apart by identity."""
    estimates = Estimates(1.0, frozenset())
    estimates.edge.observe("model", 0.100)
    first = estimates.profile(told(), TIMES, 0.300)
    estimates.edge.observe("model", 0.102)
    assert estimates.profile(told(), TIMES, 0.305) is first


@given(
    st.floats(1e-3, 0.5), st.floats(1e4, 1e7), st.lists(st.integers(20_000, 500_000), min_size=2)
)
def test_a_queue_on_a_link_is_waited_for_and_not_taken_for_slowness(
    latency: float, bandwidth: float, sizes: list[int]
) -> None:
    """All sent at once: each waits for those before it, and the bandwidth is still recovered."""
    link = LinkEstimate()
    link.observe(0, latency)
    now = 0.0
    uplink = Uplink(link, lambda: now)
    for number, size in enumerate(sizes):
        uplink.depart(number, size, 0.0)
    assert uplink.waiting == sum(sizes)
    sent = 0
    for number, size in enumerate(sizes):
        sent += size
        now = latency + sent / bandwidth
        uplink.arrive(number, now)
        assert link.bandwidth == pytest.approx(bandwidth, rel=0.01)
        left = sum(sizes[number + 1 :])
        assert uplink.waiting == left
        assert uplink.seconds(50_000) == pytest.approx(
            latency + (left + 50_000) / bandwidth, rel=0.01
        )


@given(st.floats(0.01, 30.0), st.floats(0.0, 1.0), st.integers(20_000, 500_000))
def test_a_link_that_has_become_slow_is_known_before_anything_has_crossed_it(
    overdue: float, work: float, size: int
) -> None:
    """What has been under way for so long will take as long again, for each of its size."""
    now = 0.0
    link = LinkEstimate()
    link.observe(0, 0.02)
    link.observe(50_000, 0.03)
    uplink = Uplink(link, lambda: now)
    uplink.depart("a", size, 0.0, work)
    now = link.seconds(size) + work
    assert uplink.seconds(size) == pytest.approx(link.seconds(2 * size))
    now = 0.02 + work + overdue
    expected = max(link.seconds(2 * size), 0.02 + 2 * overdue)
    assert uplink.seconds(size) == pytest.approx(expected)
    uplink.lose("a")
    assert uplink.seconds(size) == pytest.approx(link.seconds(size))


def test_what_is_lost_on_a_link_is_waited_for_no_longer() -> None:
    """And what arrives twice, or never left, tells nothing."""
    link = LinkEstimate()
    uplink = Uplink(link)
    uplink.depart("a", 100_000, 0.0)
    uplink.lose("a")
    uplink.lose("a")
    assert uplink.waiting == 0


def test_no_time_told_for_the_cloud_is_less_than_its_link_takes() -> None:
    """Over 200 kbit/s a picture of 50 kB takes two seconds, whatever the user's file says."""
    told = Profile("m", 10.0, 1000 * MILLISECOND, 100 * MILLISECOND, 300 * MILLISECOND)
    plain = Estimates(1.0, frozenset())
    assert plain.profile(told, frozenset(), None, 0.0) is told
    assert plain.profile(told, frozenset(), 0.1, 0.2).cloud_time == 300 * MILLISECOND
    assert plain.profile(told, frozenset(), 0.1, 2.0).cloud_time == 2000 * MILLISECOND
    assert plain.profile(told, frozenset(), 0.1, 0.1).cloud_time == 300 * MILLISECOND
    adapts = Estimates(1.0, frozenset({"cloud_time"}))
    assert adapts.profile(told, frozenset(), None, 2.0).cloud_time == 300 * MILLISECOND


_FAR = 10_000 * MILLISECOND


def _answer(work_ms: int) -> Message[object]:
    spans = (TraceSpan("camera", 0, 1), TraceSpan("model/done", 5, 5 + work_ms * MILLISECOND))
    return Message("model/done", 0, 0, Header(0, 0, "camera"), 0, spans, None)


def test_the_reserve_follows_the_way_and_not_the_work() -> None:
    """Work of 100 ms, whose way takes 1 to 40 ms: the 95th percentile is 38."""
    way = DeadlineReserve()
    assert way.reserve(_FAR) == 5 * MILLISECOND
    for extra in range(1, 41):
        way.travelled(_answer(100), (100 + extra) * MILLISECOND)
    assert way.reserve(_FAR) == 38 * MILLISECOND


def test_late_timers_count_on_top() -> None:
    """All 3 ms late, an execution's way taking 10."""
    way = DeadlineReserve()
    for _ in range(40):
        way.delayed(3 * MILLISECOND)
        way.travelled(_answer(50), 60 * MILLISECOND)
    assert way.reserve(_FAR) == 13 * MILLISECOND


def test_a_near_deadline_keeps_most_of_its_time() -> None:
    """At most a tenth of it is held in reserve."""
    way = DeadlineReserve()
    for _ in range(40):
        way.travelled(_answer(50), 250 * MILLISECOND)
    assert way.reserve(100 * MILLISECOND) == 10 * MILLISECOND
