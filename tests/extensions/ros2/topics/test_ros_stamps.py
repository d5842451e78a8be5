"""Ages of messages, whose clocks are strangers'."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from aerodaas.extensions.ros2.topics.stamps import MessageClock

SECOND = 1_000_000_000
NOW = 1_800_000_000 * SECOND


def test_a_clock_that_agrees_is_believed() -> None:
    """Even when messages are held up later: they are as old as they say."""
    clock = MessageClock()
    assert clock.age(NOW - SECOND // 10, NOW) == SECOND // 10
    assert clock.shared
    assert clock.age(NOW, NOW + 3 * SECOND) == 3 * SECOND


def test_simulated_time_is_no_age() -> None:
    """Its messages count from their arrival, whatever its speed."""
    clock = MessageClock()
    assert clock.age(5 * SECOND, NOW) == 0
    assert not clock.shared
    assert clock.age(5 * SECOND + 1, NOW + SECOND) == 0


def test_a_setting_decides() -> None:
    """Against what the first message suggests."""
    assert MessageClock("message").age(NOW - 9 * SECOND, NOW) == 9 * SECOND
    assert MessageClock("arrival").age(NOW - SECOND // 2, NOW) == 0


def test_what_comes_twice_or_too_late_is_told() -> None:
    """A repetition is no news."""
    clock = MessageClock()
    assert clock.age(7 * SECOND, NOW) is not None
    assert clock.age(7 * SECOND, NOW) is None
    assert clock.age(6 * SECOND, NOW) is None
    assert clock.age(7 * SECOND + 1, NOW) is not None


def test_a_simulation_that_begins_anew_is_heard() -> None:
    """And its clock is judged again."""
    clock = MessageClock()
    assert clock.age(NOW, NOW) == 0
    assert clock.age(SECOND, NOW + SECOND) == 0
    assert not clock.shared
    assert clock.age(2 * SECOND, NOW + 2 * SECOND) == 0


@given(st.integers(0, 2**62), st.integers(0, 2**62), st.integers(-SECOND, 0))
def test_an_age_is_never_negative(stamp: int, arrival: int, missing: int) -> None:
    """Nor is that of a message without a stamp known."""
    age = MessageClock().age(stamp, arrival)
    assert age is not None
    assert age >= 0
    assert MessageClock().age(missing, arrival) == 0
