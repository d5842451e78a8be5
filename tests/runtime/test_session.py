"""The grid on which things happen: rates become stamps without drift or gaps."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS, ScaledClock, SimulatedClock
from aerodaas.config.model import EnvironmentConfig
from aerodaas.runtime.node import NEVER
from aerodaas.runtime.session import CONTROL_PERIOD_NS, Session, next_due

rates = st.floats(0.1, 240.0) | st.integers(1, 240).map(float)
stamps = st.integers(-1, 10_000 * NANOSECONDS)


def _is_due(rate: float, stamp: int) -> bool:
    return next_due(rate, stamp - 1) == stamp


@given(st.lists(st.integers(0, 1000), unique=True), st.integers(-1, 1001))
def test_a_source_with_a_timetable_is_due_at_its_stamps(times: list[int], after: int) -> None:
    """At the least one later than `after`, and never after the last; others go by their rate."""
    environment = EnvironmentConfig.model_validate({"robots": [{"id": "d"}]})
    session = Session(environment, None, timetables={"camera": tuple(sorted(times))})
    expected = min((stamp for stamp in times if stamp > after), default=NEVER)
    assert session.next_due("camera", 10.0, after) == expected
    assert all(session.next_due("camera", 10.0, stamp - 1) == stamp for stamp in times)
    assert session.next_due("other", 10.0, after) == next_due(10.0, after)


@given(rates, stamps)
def test_the_next_moment_lies_ahead_within_one_period(rate: float, after: int) -> None:
    """The next due stamp is later, by at most a period, and on the grid."""
    due = next_due(rate, after)
    assert after < due <= max(after, 0) + NANOSECONDS / rate + 1
    assert _is_due(rate, due)


@given(rates, stamps)
def test_nothing_is_due_between_two_moments(rate: float, after: int) -> None:
    """The grid has no further stamp between a moment and the next."""
    due = next_due(rate, after)
    following = next_due(rate, due)
    for between in (due + 1, (due + following) // 2, following - 1):
        assert due < between < following
        assert not _is_due(rate, between)
        assert next_due(rate, between) == following


@given(rates)
def test_a_rate_is_kept_without_drift(rate: float) -> None:
    """After n moments from zero, n periods have passed, to the nanosecond's rounding."""
    moments = [next_due(rate, -1)]
    for _ in range(200):
        moments.append(next_due(rate, moments[-1]))
    assert moments[0] == 0
    for index, (before, after) in enumerate(pairwise(moments), 1):
        assert after - before == pytest.approx(NANOSECONDS / rate, abs=1.5)
        assert after == pytest.approx(index * NANOSECONDS / rate, abs=1.5)


def test_the_control_loop_runs_at_20_hz() -> None:
    """Rates that divide 20 Hz fall on turns of the control loop."""
    assert CONTROL_PERIOD_NS == 50_000_000
    for rate in (1.0, 2.0, 4.0, 5.0, 10.0, 20.0):
        moments = {next_due(rate, stamp) for stamp in range(-1, NANOSECONDS, 10_000_000)}
        assert all(_is_due(20.0, moment) for moment in moments)


def test_the_session_tells_its_clock() -> None:
    """Without a speed time is simulated; a speed scales the wall's time."""
    environment = EnvironmentConfig.model_validate({"robots": [{"id": "d"}]})
    assert isinstance(Session(environment, None).clock(), SimulatedClock)
    assert Session(environment, None).simulated
    quick = Session(environment, 5.0).starting_at(3)
    assert quick.clock() == ScaledClock(5.0, 3)
    assert quick.host_seconds(10 * NANOSECONDS) == 2.0
    assert Session(environment).id != Session(environment).id
