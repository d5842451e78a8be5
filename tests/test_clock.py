"""Mission time at other speeds than the wall's."""

from __future__ import annotations

import time

import pytest

from aerodaas import clock
from aerodaas.clock import NANOSECONDS, ScaledClock
from aerodaas.errors import ConfigError


@pytest.mark.parametrize(("speed", "expected"), [(1.0, 8.0), (4.0, 2.0), (0.5, 16.0)])
def test_sleep_until_waits_by_the_clock_s_own_speed(
    monkeypatch: pytest.MonkeyPatch, speed: float, expected: float
) -> None:
    """From second 2 of the mission to second 10 are 8 s of it, fewer or more on the host."""
    origin = 1_000 * NANOSECONDS
    host = origin + round(2 * NANOSECONDS / speed)
    slept: list[float] = []
    monkeypatch.setattr(clock, "host_time_ns", lambda: host)
    monkeypatch.setattr(time, "sleep", slept.append)
    scaled = ScaledClock(speed, origin)
    assert scaled.now() == 2 * NANOSECONDS
    scaled.sleep_until(10 * NANOSECONDS)
    assert slept == pytest.approx([expected])


@pytest.mark.parametrize("stamp", [0, 1, 2])
def test_what_is_past_is_not_slept_for(monkeypatch: pytest.MonkeyPatch, stamp: int) -> None:
    """At second 2, nor is second 2 itself."""
    slept: list[float] = []
    monkeypatch.setattr(clock, "host_time_ns", lambda: NANOSECONDS)
    monkeypatch.setattr(time, "sleep", slept.append)
    ScaledClock(2.0, 0).sleep_until(stamp * NANOSECONDS)
    assert slept == []


@pytest.mark.parametrize("speed", [0.0, -1.0, float("inf"), float("nan")])
def test_speeds_are_positive_and_finite(speed: float) -> None:
    """Nothing else is a speed."""
    with pytest.raises(ConfigError, match="speed"):
        ScaledClock(speed)
