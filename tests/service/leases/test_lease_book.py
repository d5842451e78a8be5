"""Leases: the queue's rules, one by one."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from aerodaas.protocol.schemas import LeaseIn, LeaseState, Role
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.service.leases.lease_table import Candidate, LeaseBook, lease_out
from aerodaas.service.store import Account, Lease, LeaseEnd, Store, Tenant

FLEET = {
    "near": Candidate("near", camera=True, position=(10.0, 0.0), battery_minutes=5.0),
    "far": Candidate("far", camera=True, position=(90.0, 0.0), battery_minutes=20.0),
    "blind": Candidate("blind", position=(0.0, 0.0), battery_minutes=20.0),
}
NOW = 1000.0


def ask(book: LeaseBook, *robots: str, now: float = NOW, **settings: object) -> Lease:
    """Ask for robots by id, or any one."""
    wish = LeaseIn.model_validate({"robots": list(robots) or None, **settings})
    return book.request(wish, "farm", "pilot", now, FLEET)[0]


def states(book: LeaseBook, *leases: Lease) -> list[str]:
    """As the book has them now."""
    found = (book.get(lease.id) for lease in leases)
    return [one.state.value if one else "ended" for one in found]


@pytest.fixture
def book(store: Store) -> LeaseBook:
    """Kept in a database."""
    return LeaseBook(store.leases)


def test_a_free_drone_is_granted_at_once_and_a_held_one_later(book: LeaseBook) -> None:
    """The change names both, the one that ended first."""
    first = ask(book, "near", minutes=2)
    assert (first.state, first.robots, first.ends) == (LeaseState.GRANTED, ("near",), NOW + 120)
    second = ask(book, "near")
    assert second.state is LeaseState.QUEUED
    assert lease_out(second).robots == ["near"]
    ended, granted = book.end(first.id, LeaseEnd.GIVEN_BACK, "given back", NOW + 10, FLEET)
    assert (ended.id, ended.end, ended.ended) == (first.id, LeaseEnd.GIVEN_BACK, NOW + 10)
    assert (granted.id, granted.granted) == (second.id, NOW + 10)
    with pytest.raises(RefusedError, match="no lease") as refused:
        book.end(first.id, LeaseEnd.GIVEN_BACK, "given back", NOW + 11, FLEET)
    assert refused.value.status == 404


def test_several_drones_are_granted_as_a_whole_and_nobody_overtakes(book: LeaseBook) -> None:
    """The free one is kept for the lease that waits for both; a third drone is nobody's concern."""
    held = ask(book, "near")
    both = ask(book, "near", "far")
    later = ask(book, "far")
    apart = ask(book, "blind")
    assert states(book, both, later, apart) == ["queued", "queued", "granted"]
    assert book.holder("far", NOW) is None
    book.end(held.id, LeaseEnd.GIVEN_BACK, "given back", NOW, FLEET)
    assert states(book, both, later) == ["granted", "queued"]
    assert book.holder("far", NOW) == book.get(both.id)


def test_any_one_is_the_nearest_free_one_that_fits(book: LeaseBook) -> None:
    """Camera, distance and charge count; what does not fit now is waited for by nobody."""
    assert ask(book, camera=True).robots == ("near",)
    assert ask(book, camera=True).robots == ("far",)
    assert ask(book, camera=True).state is LeaseState.QUEUED
    assert ask(book, within=50.0).robots == ("blind",)
    with pytest.raises(RefusedError, match="no drone of the fleet could ever fit") as refused:
        book.request(LeaseIn(camera=True), "farm", "pilot", NOW, {"blind": FLEET["blind"]})
    assert refused.value.status == 409


@pytest.mark.parametrize(
    ("wish", "robot"),
    [
        ({"battery_minutes": 10.0, "camera": True}, "far"),
        ({"within": 50.0, "near": (100.0, 0.0)}, "far"),
        ({"near": (9.0, 0.0)}, "near"),
        ({}, "blind"),
    ],
)
def test_any_one_has_what_was_asked_for(book: LeaseBook, wish: dict[str, Any], robot: str) -> None:
    """Each condition by itself."""
    assert ask(book, **wish).robots == (robot,)


def test_what_is_unknown_of_a_drone_fits_nothing(book: LeaseBook) -> None:
    """Neither its place nor its charge."""
    fleet = {"a": Candidate("a")}
    for wish in (LeaseIn(within=1e6), LeaseIn(battery_minutes=0.1)):
        assert book.request(wish, "farm", "pilot", NOW, fleet)[0].state is LeaseState.QUEUED
    assert book.request(LeaseIn(), "farm", "pilot", NOW, fleet)[0].state is LeaseState.GRANTED


def test_a_lease_is_over_to_the_second(book: LeaseBook) -> None:
    """It holds nothing from then on, even before anybody was told."""
    lease = ask(book, "near", minutes=1)
    assert book.advance(NOW + 59.9, FLEET) == ()
    assert book.holder("near", NOW + 59.9) == lease
    assert book.holder("near", NOW + 60) is None
    (ended,) = book.advance(NOW + 75, FLEET)
    assert (ended.end, ended.ended) == (LeaseEnd.EXPIRED, NOW + 60)
    assert book.live() == []


def test_a_drone_that_still_comes_home_is_nobody_elses(book: LeaseBook) -> None:
    """The next in line gets it when it has landed."""
    first = ask(book, "near")
    second = ask(book, "near")
    flying = FLEET | {"near": replace(FLEET["near"], busy=True)}
    (ended,) = book.end(first.id, LeaseEnd.REVOKED, "a storm", NOW, flying)
    assert (ended.end, ended.reason) == (LeaseEnd.REVOKED, "a storm")
    assert book.advance(NOW + 1, flying) == ()
    (granted,) = book.advance(NOW + 2, FLEET)
    assert granted.id == second.id


def test_a_drone_out_of_service_is_refused_and_holds_up_nobody(book: LeaseBook) -> None:
    """One that goes out of service while it is waited for."""
    held = ask(book, "near")
    both = ask(book, "near", "far")
    resting = FLEET | {"near": replace(FLEET["near"], objection="out of service")}
    with pytest.raises(RefusedError, match="near: out of service") as refused:
        book.request(LeaseIn(robots=["near"]), "farm", "pilot", NOW, resting)
    assert refused.value.status == 409
    later, _ = book.request(LeaseIn(robots=["far"]), "farm", "pilot", NOW, resting)
    assert later.state is LeaseState.GRANTED
    book.end(held.id, LeaseEnd.GIVEN_BACK, "given back", NOW, resting)
    assert states(book, both) == ["queued"]
    book.end(later.id, LeaseEnd.GIVEN_BACK, "given back", NOW, FLEET)
    assert states(book, both) == ["granted"]


def test_an_extension_lasts_if_nobody_waits_and_the_quota_allows(book: LeaseBook) -> None:
    """Up to a day in all."""
    lease = ask(book, "near", "far", minutes=10)
    with pytest.raises(RefusedError, match=r"leaves 9\.0 minutes") as refused:
        book.extend(lease.id, 5, NOW, FLEET, allowed=9.0)
    assert refused.value.status == 403
    longer, _ = book.extend(lease.id, 5, NOW, FLEET, allowed=10.0)
    assert (longer.ends, longer.minutes) == (NOW + 900, 15)
    for minutes in (0, -1, 24 * 60 - 14, float("nan"), float("inf")):
        with pytest.raises(RefusedError, match="a day at most"):
            book.extend(lease.id, minutes, NOW, FLEET)
    waiting = ask(book, "far")
    with pytest.raises(RefusedError, match="another waits"):
        book.extend(lease.id, 1, NOW, FLEET)
    with pytest.raises(RefusedError, match="is queued"):
        book.extend(waiting.id, 1, NOW, FLEET)
    with pytest.raises(RefusedError, match="no lease"):
        book.extend(lease.id, 1, NOW + 900, FLEET)


def test_what_cannot_be_asked_for(book: LeaseBook) -> None:
    """Unknown, twice, and too many."""
    with pytest.raises(RefusedError, match=r"no robot mole; it has: blind, far, near") as refused:
        ask(book, "mole")
    assert refused.value.status == 404
    with pytest.raises(RefusedError, match="each robot once") as refused:
        ask(book, "near", "near")
    assert refused.value.status == 422
    for _ in range(51):
        ask(book, "near")
    with pytest.raises(RefusedError, match="too many leases wait") as refused:
        ask(book, "near")
    assert refused.value.status == 429


def test_what_a_tenant_holds_and_waits_for_is_committed(book: LeaseBook) -> None:
    """In minutes times robots, from now on."""
    ask(book, "near", "far", minutes=10)
    ask(book, "near", minutes=7)
    ask(book, camera=True, minutes=3)
    assert book.committed("farm", NOW) == pytest.approx(30)
    assert book.committed("farm", NOW + 120) == pytest.approx(26)
    assert book.committed("campus", NOW) == 0


def test_a_restart_finds_its_leases_and_ends_those_that_are_over(store: Store) -> None:
    """Those that wait move up, in their order."""
    book = LeaseBook(store.leases)
    short = ask(book, "near", minutes=1)
    long = ask(book, "far", minutes=60)
    waits = [ask(book, "near"), ask(book, "near")]
    again = LeaseBook(store.leases)
    assert again.live() == book.live()
    assert again.holder("near", NOW + 61) is None
    news = again.advance(NOW + 61, FLEET)
    assert [(one.id, one.state) for one in news] == [
        (short.id, LeaseState.ENDED),
        (waits[0].id, LeaseState.GRANTED),
    ]
    assert states(again, long, waits[1]) == ["granted", "queued"]
    assert ask(again, "far", now=NOW + 61).number > waits[1].number


def test_while_the_database_is_gone_leases_end_and_none_is_granted(tmp_path: Path) -> None:
    """What ended is written when it is back; what was waiting is granted then."""
    path = tmp_path / "service.db"
    with Store.open(path) as store:
        store.tenants.add(Tenant("farm"))
        store.accounts.add(Account("pilot", "farm", Role.PILOT, frozenset(), 0.0))
        book = LeaseBook(store.leases)
        first, second = ask(book, "near", minutes=1), ask(book, "near")
        path.rename(tmp_path / "away.db")
        with pytest.raises(StoreError, match="is gone"):
            ask(book, "far")
        assert book.holder("far", NOW) is None
        assert [one.id for one in book.advance(NOW + 60, FLEET)] == [first.id]
        assert states(book, second) == ["queued"]
        (tmp_path / "away.db").rename(path)
        assert [one.id for one in book.advance(NOW + 61, FLEET)] == [second.id]
        assert store.leases.require(first.id).end is LeaseEnd.EXPIRED
        assert ask(book, "far").state is LeaseState.GRANTED


def test_of_threads_that_ask_for_one_drone_one_gets_it(book: LeaseBook) -> None:
    """The others wait in an order."""
    leases: list[Lease] = []

    def request() -> None:
        leases.append(ask(book, "near"))

    threads = [threading.Thread(target=request) for _ in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(lease.state.value for lease in leases) == ["granted"] + ["queued"] * 15
    assert len({lease.number for lease in leases}) == 16
