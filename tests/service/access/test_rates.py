"""No sender gets more than its share, and none takes that of another."""

from __future__ import annotations

import math
from collections.abc import Callable

import hypothesis.strategies as st
import pytest
from hypothesis import given

from aerodaas.service.errors import RefusedError
from aerodaas.service.http.limits import RateLimiter, RequestLimits, WrongTokens


def limiter_of(rate: float, burst: float, clock: Callable[[], float]) -> RateLimiter:
    """A limiter of `rate` requests a second and `burst` at once."""
    return RateLimiter(RequestLimits(rate=rate, burst=burst), clock)


def admitted(limiter: RateLimiter, account: str) -> float:
    """0 if a request is admitted, or the seconds to wait."""
    try:
        limiter.admit(account)
    except RefusedError as error:
        return error.retry_after or math.nan
    return 0.0


@given(
    rate=st.floats(0.5, 50.0),
    burst=st.integers(1, 20),
    pauses=st.lists(st.floats(0.0, 2.0), min_size=1, max_size=80),
)
def test_in_any_span_of_time_no_more_than_burst_and_rate(
    rate: float, burst: int, pauses: list[float]
) -> None:
    """From each admitted request to each later one."""
    now = [0.0]
    limiter = limiter_of(rate, burst, clock=lambda: now[0])
    times = []
    for pause in pauses:
        now[0] += pause
        if not admitted(limiter, "a"):
            times.append(now[0])
    for first, begin in enumerate(times):
        for last in range(first, len(times)):
            assert last - first + 1 <= burst + rate * (times[last] - begin) + 1e-6


def test_who_waits_as_told_is_admitted() -> None:
    """And a refused request costs nothing."""
    now = [0.0]
    limiter = limiter_of(2.0, 3.0, clock=lambda: now[0])
    assert [admitted(limiter, "a") for _ in range(5)] == [0, 0, 0, 0.5, 0.5]
    now[0] += 0.5
    assert [admitted(limiter, "a") for _ in range(2)] == [0, 0.5]
    now[0] += 60
    assert [admitted(limiter, "a") for _ in range(4)] == [0, 0, 0, 0.5]


def test_one_sender_takes_nothing_of_another() -> None:
    """Each key has a bucket of its own."""
    limiter = limiter_of(1.0, 1.0, clock=lambda: 0.0)
    assert not admitted(limiter, "a")
    assert admitted(limiter, "a")
    assert not admitted(limiter, "b")


def test_many_senders_take_a_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever asked least lately is forgotten, not whoever asks most."""
    monkeypatch.setattr(RequestLimits, "rated_accounts", 10)
    limiter = limiter_of(1.0, 1.0, clock=lambda: 0.0)
    admitted(limiter, "greedy")
    for number in range(1000):
        admitted(limiter, f"address {number}")
        assert admitted(limiter, "greedy")
    assert len(limiter._buckets) == 10


def test_a_clock_that_goes_back_fills_nothing() -> None:
    """Nor does it take anything."""
    now = [10.0]
    limiter = limiter_of(1.0, 2.0, clock=lambda: now[0])
    admitted(limiter, "a")
    now[0] = 0.0
    assert not admitted(limiter, "a")
    assert math.isclose(admitted(limiter, "a"), 1.0)
    with pytest.raises(RefusedError, match="wait 1 s") as refused:
        limiter.admit("a")
    assert refused.value.status == 429


def test_many_peers_are_limited_together_and_forgotten() -> None:
    """One alert for all of them; a minute later the counts begin anew."""
    now, told = [0.0], list[str]()
    wrong = WrongTokens(told.append, lambda: now[0])
    pauses = [wrong.count(f"fd00::{index}:1:2:3:4") for index in range(1)]
    pauses += [wrong.count(f"10.0.{index // 200}.{index % 200}") for index in range(5000)]
    assert pauses[:100] == [0] * 100
    assert min(pauses[101:]) >= 1
    assert told == ["remote control: 100 wrong tokens from several addresses"]
    assert len(wrong._peers) == 1024
    now[0] = 61.0
    assert wrong.count("10.0.0.1") == 0
