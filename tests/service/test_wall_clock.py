"""The wall clock is set by an hour: leases, links and tokens last as long as they were to."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from offered import PILOT, Provider

from aerodaas.messages.health import HealthItem, Verdict
from aerodaas.protocol.schemas import AccountIn, LeaseIn, LeaseState, LinkState, TokenIn
from aerodaas.service.access.accounts import Access, Accounts
from aerodaas.service.access.audit import Audit
from aerodaas.service.access.quotas import Quotas
from aerodaas.service.errors import RefusedError
from aerodaas.service.flights.orders import FlightOrder
from aerodaas.service.flights.server import LeaseWatch
from aerodaas.service.leases.lease_service import LeaseService
from aerodaas.service.store import Store

HOUR = 3600.0
STEPS = [HOUR, -HOUR, 56 * 365 * 24 * HOUR]
"""Seconds: forward, backward, and from 1970 on."""


class WallClock:
    """The machine's wall clock, which a test sets; `time.monotonic` goes on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        real, self.ahead = time.time, 0.0
        monkeypatch.setattr(time, "time", lambda: real() + self.ahead)


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> WallClock:
    """Right until a test sets it."""
    return WallClock(monkeypatch)


@pytest.fixture
def provider(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wall: WallClock
) -> Iterator[Provider]:
    """Two drones."""
    del wall
    made = Provider(tmp_path, monkeypatch)
    yield made
    made.missions.close()
    made.store.close()


def minutes_left(leases: LeaseService, lease: str) -> float:
    """Until the end of a lease by the wall clock, as whoever reads it counts."""
    ends = leases.lease(lease).ends
    return -math.inf if ends is None else (ends - time.time()) / 60.0


@pytest.mark.parametrize("step", STEPS)
def test_a_granted_lease_keeps_its_minutes(
    provider: Provider, wall: WallClock, step: float
) -> None:
    """Also in the database, and the next one in the queue waits as long."""
    held = provider.leases.request(PILOT, LeaseIn(robots=["one"], minutes=20))
    waits = provider.leases.request(PILOT, LeaseIn(robots=["one"], minutes=20))
    wall.ahead += step
    provider.leases.advance()
    assert provider.leases.lease(held.id).state is LeaseState.GRANTED
    assert provider.leases.lease(waits.id).state is LeaseState.QUEUED
    assert minutes_left(provider.leases, held.id) == pytest.approx(20.0, abs=0.1)
    assert provider.store.leases.require(held.id).ends == provider.leases.lease(held.id).ends


@pytest.mark.parametrize("step", STEPS)
def test_a_flight_in_its_second_minute_is_not_recalled(
    provider: Provider, wall: WallClock, step: float
) -> None:
    """It is told the new moment of its end alone."""
    mission = provider.flying()
    asked = provider.missions._missions[mission.id].follow().asked  # type: ignore[attr-defined]
    asked.clear()
    wall.ahead += step
    provider.turns()
    (told,) = asked
    assert (told.ends - time.time()) / 60.0 == pytest.approx(15.0, abs=0.1)


@pytest.mark.parametrize("step", STEPS)
def test_a_service_that_starts_again_knows_of_the_step(
    tmp_path: Path, provider: Provider, wall: WallClock, step: float
) -> None:
    """While none ran, the clock was set."""
    parts = provider.settings.config, provider.store, provider.registry, Quotas(provider.store)
    clock = tmp_path / "clock"
    lease = LeaseService(*parts, clock).request(PILOT, LeaseIn(robots=["one"], minutes=20))
    wall.ahead += step
    for _ in range(2):
        again = LeaseService(*parts, clock)
        again.advance()
        assert again.lease(lease.id).state is LeaseState.GRANTED
        assert minutes_left(again, lease.id) == pytest.approx(20.0, abs=0.1)


def test_an_offset_of_another_boot_moves_nothing(tmp_path: Path, provider: Provider) -> None:
    """`time.monotonic` begins anew with the machine; the file may be anything, too."""
    parts = provider.settings.config, provider.store, provider.registry, Quotas(provider.store)
    clock = tmp_path / "clock"
    for content in ('{"boot": "another", "seconds": 7.0}', "{", ""):
        clock.write_text(content)
        leases = LeaseService(*parts, clock)
        lease = leases.request(PILOT, LeaseIn(robots=["one"], minutes=20))
        leases.advance()
        assert minutes_left(leases, lease.id) == pytest.approx(20.0, abs=0.1)
        leases.end(PILOT, lease.id)


@pytest.mark.parametrize("step", STEPS)
def test_a_flight_that_starts_meanwhile_has_its_whole_lease(
    provider: Provider, wall: WallClock, step: float
) -> None:
    """Its order was written by the clock of before; one that is over is over, too."""
    mission = provider.flying()
    order = FlightOrder.read(provider.missions._missions[mission.id].flight.order)
    wall.ahead += step
    recalled: list[str] = []
    for ends, over in ((order.ends, False), (order.ends - 16 * 60, True)):
        watch = LeaseWatch(order.model_copy(update={"ends": ends}), recalled.append)
        assert bool(watch._due()) is over


@pytest.mark.parametrize("step", STEPS)
def test_a_lost_drone_is_neither_leased_nor_forgotten(
    provider: Provider, wall: WallClock, step: float
) -> None:
    """A link that was lost a minute ago stays lost, and a dropout of a moment refuses nobody."""
    provider.monitor.see("one", link=LinkState.LOST, since=time.time() - 60)
    provider.monitor.see("two", link=LinkState.LOST, since=time.time())
    wall.ahead += step
    assert "not reachable" in provider.registry.objection("one")
    assert provider.registry.objection("two") == ""


def test_a_list_before_take_off_is_as_old_as_it_is(provider: Provider, wall: WallClock) -> None:
    """Not an hour older."""
    items = (HealthItem("wind", "2.0 m/s", "at most 10", Verdict.GOOD),)
    provider.monitor.see("one", health=items, examined=time.time() - 2)
    wall.ahead += HOUR
    assert provider.registry.preflight("one").age == pytest.approx(2.0, abs=1.0)


def test_tokens_of_a_service_that_began_in_1970_are_good_once_the_clock_is_set(
    tmp_path: Path,
) -> None:
    """For as many days as they were issued for, from then on; a revoked one never."""
    now = [1000.0]
    with Store.open(tmp_path / "service.db") as store:
        accounts = Accounts(store, lambda: now[0])
        access = Access(store, Audit(store), clock=lambda: now[0])
        first = str(accounts.first_token())
        accounts.add(AccountIn(name="pilot", tenant="farm"))
        revoked = accounts.issue(TokenIn(account="pilot", days=1))
        accounts.revoke(revoked.id)
        assert access.of(first, "").account == "admin"
        now[0] = 1.8e9
        assert access.of(first, "").account == "admin"
        with pytest.raises(RefusedError):
            access.of(str(revoked.secret), "")
        now[0] += 364 * 86400
        assert access.of(first, "").account == "admin"
        now[0] += 2 * 86400
        with pytest.raises(RefusedError):
            access.of(first, "")
