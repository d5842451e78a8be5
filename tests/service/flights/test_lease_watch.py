"""The watch over a lease: its end and a silent user bring the drones home, once."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from flight_orders import order_in

from aerodaas.protocol.schemas import SilencePolicy
from aerodaas.service.flights.server import LeaseWatch

pytestmark = pytest.mark.wall_clock

LONG = 3600.0


class Drones:
    """What the watch calls home."""

    def __init__(self) -> None:
        self.reasons: list[str] = []
        self.called = threading.Event()

    def __call__(self, reason: str) -> None:
        """Come home."""
        self.reasons.append(reason)
        self.called.set()


def watch(
    drones: Drones, ends: float, cancelled: Callable[[], str] = str, **changes: object
) -> LeaseWatch:
    """A watch over a lease that ends `ends` seconds from now."""
    order = order_in(Path(), ends=time.time() + ends, **changes)
    return LeaseWatch(order, drones, cancelled)


def test_the_end_of_a_lease_brings_the_drones_home() -> None:
    """Once, with the reason; afterwards it cannot be extended."""
    drones = Drones()
    lease = watch(drones, 0.3)
    lease.start()
    assert drones.called.wait(10)
    assert drones.reasons == ["the lease has ended"] == [lease.reason]
    assert not lease.extend(time.time() + LONG)
    lease.end("again")
    time.sleep(0.5)
    assert drones.reasons == ["the lease has ended"]


def test_a_lease_that_is_extended_goes_on() -> None:
    """Also by a clock that was set in between."""
    drones = Drones()
    lease = watch(drones, 0.6)
    assert lease.extend(time.time() + LONG)
    lease.start()
    assert not drones.called.wait(1.2)
    assert lease.reason == ""
    lease.stop()


def test_a_clock_that_is_set_does_not_prolong_a_lease(monkeypatch: pytest.MonkeyPatch) -> None:
    """The end was fixed on the monotonic clock when the flight began."""
    drones = Drones()
    lease = watch(drones, 0.5)
    real = time.time
    monkeypatch.setattr(time, "time", lambda: real() - LONG)
    lease.start()
    assert drones.called.wait(10)
    assert drones.reasons == ["the lease has ended"]


@pytest.mark.parametrize(("policy", "home"), [("return", True), ("continue", False)])
def test_silence_is_a_reason_where_the_policy_says_so(policy: str, *, home: bool) -> None:
    """And none where it does not."""
    drones = Drones()
    lease = watch(drones, LONG, silence=SilencePolicy(policy), silence_seconds=0.4)
    lease.start()
    assert drones.called.wait(1.5) is home
    lease.stop()
    assert all("nothing was heard of the user" in reason for reason in drones.reasons)


def test_a_user_who_is_heard_is_not_silent() -> None:
    """Each word counts from its moment on."""
    drones = Drones()
    lease = watch(drones, LONG, silence=SilencePolicy.RETURN, silence_seconds=1.0)
    lease.start()
    for _ in range(8):
        lease.record_presence()
        assert not drones.called.wait(0.25)
    assert drones.called.wait(10)


def test_a_cancellation_brings_the_drones_home_at_once_or_later() -> None:
    """One that came before the watch is told before it starts: the flight does not begin then."""
    drones, cancelled = Drones(), ["cancelled by pilot"]
    lease = watch(drones, LONG, cancelled=lambda: cancelled[0])
    lease.start()
    assert drones.reasons == cancelled == [lease.reason]
    drones, cancelled[0] = Drones(), ""
    lease = watch(drones, LONG, cancelled=lambda: cancelled[0])
    lease.start()
    assert lease.reason == ""
    cancelled[0] = "cancelled by operator"
    assert drones.called.wait(10)
    assert drones.reasons == cancelled
