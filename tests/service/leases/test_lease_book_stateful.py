"""The book of leases keeps its promises whatever is asked of it, and in whatever order."""

from __future__ import annotations

import itertools
import math
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from aerodaas.protocol.schemas import USUAL_SCOPES, LeaseIn, LeaseState, Role
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.service.leases.lease_table import Candidate, LeaseBook
from aerodaas.service.store import Account, Lease, LeaseEnd, Store, Tenant

ROBOTS = ("a", "b", "c", "d")
TENANTS = ("farm", "campus")
WISHES = st.one_of(
    st.builds(
        LeaseIn,
        robots=st.lists(st.sampled_from(ROBOTS), min_size=1, max_size=3, unique=True),
        minutes=st.sampled_from([1, 5, 30]),
    ),
    st.builds(
        LeaseIn,
        camera=st.booleans(),
        within=st.none() | st.just(50.0),
        battery_minutes=st.none() | st.just(10.0),
        minutes=st.sampled_from([1, 5, 30]),
    ),
)


class MemoryShelf:
    """Keeps leases as the store does, and fails when it is told to."""

    def __init__(self) -> None:
        self.rows: dict[str, Lease] = {}
        self.fails = False

    def live(self) -> list[Lease]:
        """In the queue's order."""
        rows = [row for row in self.rows.values() if row.state is not LeaseState.ENDED]
        return sorted(rows, key=lambda row: row.number)

    def put(self, *rows: Lease) -> None:
        """All or none."""
        if self.fails:
            raise StoreError("the database is full")
        self.rows |= {row.id: row for row in rows}

    def highest_number(self) -> int:
        """0 before the first."""
        return max((row.number for row in self.rows.values()), default=0)


class Leases(RuleBasedStateMachine):
    """Two tenants, four drones, one of them without a camera, and a database that may fail."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 1000.0
        self.ids = map(str, itertools.count())
        self.fleet = {
            id_: Candidate(
                id_, camera=id_ != "d", position=(20.0 * place, 0.0), battery_minutes=30.0
            )
            for place, id_ in enumerate(ROBOTS)
        }
        self.told: dict[str, Lease] = {}
        self.asked: dict[str, Lease] = {}
        self.shelf = self.make_shelf()
        self.book = LeaseBook(self.shelf, lambda: next(self.ids))

    def make_shelf(self) -> Any:  # noqa: ANN401 - the table, or a stand-in
        """Where the leases are kept."""
        return MemoryShelf()

    @rule(wish=WISHES, tenant=st.sampled_from(TENANTS))
    def request(self, wish: LeaseIn, tenant: str) -> None:
        """Refused for a robot out of service, and not carried out while the database fails."""
        resting = any(self.fleet[id_].objection for id_ in wish.robots or ())
        try:
            lease, news = self.book.request(wish, tenant, "pilot", self.now, self.fleet)
        except StoreError:
            assert self.fails()
            return
        except RefusedError:
            assert resting
            return
        assert not resting
        assert not self.fails()
        self.asked[lease.id] = replace(lease, state=LeaseState.QUEUED, robots=())
        self.record_presence(news)

    @precondition(lambda self: self.book.live())
    @rule(data=st.data(), minutes=st.sampled_from([1.0, 20.0]))
    def extend(self, data: st.DataObject, minutes: float) -> None:
        """Only if nobody waits for its robots."""
        lease = data.draw(st.sampled_from(self.book.live()))
        try:
            longer, news = self.book.extend(lease.id, minutes, self.now, self.fleet)
        except (RefusedError, StoreError):
            self.advance()
            return
        # One that was queued, and whose turn has come since anybody looked, is granted first.
        before = self.now + 60 * lease.minutes if lease.ends is None else lease.ends
        assert longer.ends == before + 60 * minutes
        for other in self.queued():
            assert not self.usable(other) & set(longer.robots)
        self.record_presence(news)

    @precondition(lambda self: self.book.live())
    @rule(data=st.data(), end=st.sampled_from([LeaseEnd.REVOKED, LeaseEnd.GIVEN_BACK]))
    def end(self, data: st.DataObject, end: LeaseEnd) -> None:
        """It ends, also while the database fails."""
        lease = data.draw(st.sampled_from(self.book.live()))
        if lease.ends is not None and lease.ends <= self.now:
            return
        news = self.book.end(lease.id, end, "bad weather", self.now, self.fleet)
        assert [one.end is not None for one in news if one.id == lease.id][-1]
        self.record_presence(news)

    @rule(seconds=st.sampled_from([1.0, 59.0, 60.0, 300.0, 4000.0]), looks=st.booleans())
    def pass_time(self, seconds: float, *, looks: bool) -> None:
        """Somebody looks afterwards, or nobody does."""
        self.now += seconds
        if looks:
            self.advance()

    @rule()
    def advance(self) -> None:
        """Nothing that somebody can use lies idle."""
        self.record_presence(self.book.advance(self.now, self.fleet))
        for lease in self.book.live():
            assert lease.ends is None or lease.ends > self.now
        if self.fails():
            return
        free = {id_ for id_ in ROBOTS if not self.fleet[id_].busy} - self.held()
        for lease in self.queued():
            wanted = self.usable(lease)
            if lease.wanted:
                assert not wanted or not wanted <= free, "its robots lie idle"
            else:
                assert not wanted & free, "one that fits lies idle"
            free -= wanted

    @rule(
        id_=st.sampled_from(ROBOTS),
        objection=st.sampled_from(["", "out of service"]),
        busy=st.booleans(),
        minutes=st.sampled_from([None, 5.0, 30.0]),
        east=st.sampled_from([None, 0.0, 100.0]),
    )
    def change_robot(
        self, id_: str, *, objection: str, busy: bool, minutes: float | None, east: float | None
    ) -> None:
        """It is charged, moved, or taken out of service."""
        position = None if east is None else (east, 0.0)
        self.fleet[id_] = replace(
            self.fleet[id_],
            objection=objection,
            busy=busy,
            battery_minutes=minutes,
            position=position,
        )

    @rule(fails=st.booleans())
    def database(self, *, fails: bool) -> None:
        """It fails, or works again."""
        if isinstance(self.shelf, MemoryShelf):
            self.shelf.fails = fails

    @rule()
    def restart(self) -> None:
        """What was told, or will be, is what the next book finds; the time goes on meanwhile."""
        if self.fails():
            return
        self.record_presence(self.book.advance(self.now, self.fleet))
        before = self.book.live()
        self.book = LeaseBook(self.shelf, lambda: next(self.ids))
        assert self.book.live() == before

    @invariant()
    def one_lease_holds_a_robot(self) -> None:
        """Never two, and none after its end."""
        held = [
            robot
            for lease in self.book.live()
            if lease.ends is not None and lease.ends > self.now
            for robot in lease.robots
        ]
        assert len(held) == len(set(held))
        for robot in ROBOTS:
            assert (self.book.holder(robot, self.now) is not None) == (robot in held)

    def record_presence(self, news: tuple[Lease, ...]) -> None:
        """Each change of state is told once, in order, and keeps to the queue."""
        for lease in news:
            before = self.told.get(lease.id)
            if lease.state is LeaseState.GRANTED:
                assert before is None
                self.check_grant(lease)
            else:
                assert lease.state is LeaseState.ENDED
                assert before is None or before.state is LeaseState.GRANTED
            self.told[lease.id] = lease
        if news:
            self.check_told()

    def check_grant(self, lease: Lease) -> None:
        """It has what it asked for, for its minutes, and has overtaken nobody."""
        asked = self.asked[lease.id]
        assert lease.granted == self.now
        assert lease.ends == self.now + 60 * asked.minutes
        assert not any(self.fleet[robot].busy for robot in lease.robots)
        assert set(lease.robots) <= self.usable(asked)
        if asked.wanted:
            assert lease.robots == asked.wanted
        else:
            assert len(lease.robots) == 1
        for other in self.queued():
            if other.number < lease.number:
                assert not self.usable(other) & set(lease.robots), "it has overtaken"

    def check_told(self) -> None:
        """Who was told of all news knows what the book knows."""
        for lease in self.book.live():
            told = self.told.get(lease.id)
            assert (told.state if told else LeaseState.QUEUED) is lease.state

    def queued(self) -> list[Lease]:
        """Those that wait, in order."""
        return [lease for lease in self.book.live() if lease.state is LeaseState.QUEUED]

    def held(self) -> set[str]:
        """Robots of granted leases."""
        return {robot for lease in self.book.live() for robot in lease.robots}

    def usable(self, lease: Lease) -> set[str]:
        """What a lease could have now, in the words of the request."""
        if lease.wanted:
            ready = not any(self.fleet[one].objection for one in lease.wanted)
            return set(lease.wanted) if ready else set()
        return {
            one.id
            for one in self.fleet.values()
            if not one.objection
            and not (lease.camera and not one.camera)
            and not (
                lease.within is not None
                and (one.position is None or math.hypot(*one.position) > lease.within)
            )
            and not (
                lease.battery_minutes is not None
                and (one.battery_minutes is None or one.battery_minutes < lease.battery_minutes)
            )
        }

    def fails(self) -> bool:
        """Whether the database fails."""
        return isinstance(self.shelf, MemoryShelf) and self.shelf.fails


class KeptLeases(Leases):
    """The same, kept in a database."""

    def make_shelf(self) -> Any:  # noqa: ANN401 - the table, or a stand-in
        """In a file."""
        self.folder = tempfile.TemporaryDirectory(prefix="aerodaas-")
        self.store = Store.open(Path(self.folder.name) / "service.db")
        for tenant in TENANTS:
            self.store.tenants.add(Tenant(tenant))
        self.store.accounts.add(Account("pilot", "farm", Role.PILOT, frozenset(USUAL_SCOPES), 0.0))
        return self.store.leases

    def teardown(self) -> None:
        """Remove it."""
        self.store.close()
        self.folder.cleanup()


TestLeases = Leases.TestCase
TestLeases.settings = settings(max_examples=100, stateful_step_count=40)
TestKeptLeases = KeptLeases.TestCase
TestKeptLeases.settings = settings(max_examples=10, stateful_step_count=25)
