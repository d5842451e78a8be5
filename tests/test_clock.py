"""Mission time at other speeds than the wall's."""

from __future__ import annotations

import pickle
import subprocess
import sys
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas import clock
from aerodaas.clock import NANOSECONDS, ScaledClock, SimulatedClock
from aerodaas.errors import ClockError, ConfigError


@pytest.mark.parametrize(("speed", "expected"), [(1.0, 8.0), (4.0, 2.0), (0.5, 16.0), (16.0, 0.5)])
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


@given(st.lists(st.integers(0, 10 * NANOSECONDS), min_size=1))
def test_simulated_time_goes_only_forward(stamps: list[int]) -> None:
    """It starts at zero, reads what it was last advanced to, and keeps that when told less."""
    simulated = SimulatedClock()
    assert simulated.now() == 0
    reached = 0
    for stamp in stamps:
        if stamp < reached:
            with pytest.raises(ClockError, match="backwards"):
                simulated.advance_to(stamp)
        else:
            simulated.advance_to(stamp)
            reached = stamp
        assert simulated.now() == reached
        simulated.sleep_until(reached)


def test_a_sleeper_wakes_at_its_stamp_and_no_sooner() -> None:
    """Woken at 9 it sleeps on; at 10 it goes on."""
    simulated = SimulatedClock()
    woke: list[int] = []

    def sleep() -> None:
        simulated.sleep_until(10)
        woke.append(simulated.now())

    sleeper = threading.Thread(target=sleep, daemon=True)
    sleeper.start()
    simulated.advance_to(9)
    sleeper.join(0.05)
    assert woke == []
    simulated.advance_to(10)
    sleeper.join(10)
    assert woke == [10]


@pytest.mark.parametrize("hours", [1, -1])
def test_processes_of_one_machine_count_alike_if_the_wall_clock_is_set_between_their_starts(
    hours: int,
) -> None:
    """One that unpickles the other's epoch; of another machine it means nothing."""
    program = (
        "import pickle, sys, time\n"
        "real, whole = time.time, time.time_ns\n"
        f"time.time = lambda: real() + {hours} * 3600\n"
        f"time.time_ns = lambda: whole() + {hours} * 3600 * 10**9\n"
        "from aerodaas import clock\n"
        "print(clock.host_time_ns())\n"
        "epoch = sys.stdin.buffer.read()\n"
        "clock._adopted('another', 5)\n"
        "print(clock.host_time_ns())\n"
        "pickle.loads(epoch)\n"
        "print(clock.host_time_ns())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        input=pickle.dumps(clock.HostEpoch()),
        capture_output=True,
        check=True,
    )
    apart = [(int(line) - clock.host_time_ns()) / NANOSECONDS for line in done.stdout.split()]
    assert apart == pytest.approx([3600 * hours, 3600 * hours, 0], abs=60)


def test_seconds_and_host_time() -> None:
    """A second is 1e9 ns; host time counts from the Unix epoch."""
    assert clock.seconds(2_500_000_000) == 2.5
    assert abs(clock.host_time_ns() - time.time_ns()) < 3600 * NANOSECONDS
