"""What is kept comes back as it was, to everyone, and in the order that is promised."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import pytest

from aerodaas.protocol.schemas import LeaseState, MissionPhase, Role, Scope
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.service.store import (
    Account,
    AuditEntry,
    Lease,
    LeaseEnd,
    Mission,
    RobotState,
    Store,
    Tenant,
    Token,
    Usage,
)

LEASE = Lease(
    id="l1",
    number=1,
    tenant="farm",
    account="pilot",
    minutes=0.1,
    asked=1e9 / 3,
    wanted=("a", "b"),
    camera=True,
    within=12.5,
    near=(-1.0, 2.0),
    battery_minutes=3.0,
    area=((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)),
    state=LeaseState.ENDED,
    robots=("a", "b"),
    granted=1.0,
    ends=2.0,
    ended=1.5,
    end=LeaseEnd.REVOKED,
    reason="wind; Böen, 風",
)
MISSION = Mission(
    id="m1",
    name="survey",
    tenant="farm",
    account="pilot",
    phase=MissionPhase.SUBMITTED,
    robots=("a",),
    submitted=5.0,
    folder="/somewhere/m1",
    reason="",
    lease="l1",
    request={"minutes": 3.5, "share": ["campus"], "seed": None},
    verdict={"approved": False, "reasons": ["outside the fence"]},
)
USAGE = Usage("m1", "farm", "pilot", 5.0, 60.5, 100.25, 0.1, {"edge": 1.5}, 8, 2**40, kept=False)


@pytest.mark.parametrize(
    ("part", "key", "row"),
    [
        ("tenants", "t", Tenant("t", 1.0, 2.0, 3.0, 5, 2**40, 6.5, 7.5)),
        ("tenants", "u", Tenant("u")),
        ("accounts", "x", Account("x", "farm", Role.ADMIN, frozenset(), 1.0, disabled=True)),
        (
            "tokens",
            "id",
            Token("id", "pilot", "d", frozenset({Scope.FLY, Scope.SENSE}), 1.0, 2.0, revoked=True),
        ),
        ("robots", "a", RobotState("a", False, 0.5, (1.0, 2.0, 3.0), 4.0)),  # noqa: FBT003
        ("robots", "b", RobotState("b")),
        ("leases", "l1", LEASE),
        ("missions", "m1", MISSION),
        ("usage", "m1", USAGE),
    ],
)
def test_a_row_comes_back_as_it_was(store: Store, part: str, key: str, row: object) -> None:
    """Each field of each class, also when it was kept over another one."""
    if part in {"missions", "usage"}:
        store.leases.put(LEASE)
    if part == "usage":
        store.missions.add(MISSION)
    rows = getattr(store, part)
    assert rows.get(key) is None
    rows.add(row)
    assert rows.get(key) == row
    assert rows.require(key) == row
    rows.put(row)
    assert rows.get(key) == row
    with pytest.raises(RefusedError, match="already") as refused:
        rows.add(row)
    assert refused.value.status == 409


@pytest.mark.parametrize("text", ["a\0b", "half \ud800 of a pair", "'; DROP TABLE leases; --"])
def test_a_text_of_a_stranger_harms_nothing(store: Store, text: str) -> None:
    """What a database cannot hold is replaced."""
    store.leases.put(replace(LEASE, reason=text))
    kept = store.leases.require("l1")
    assert kept.reason.isprintable()
    assert len(kept.reason) == len(text)


def test_another_opening_finds_it_again(place: str | Path) -> None:
    """A service that starts again."""
    with Store.open(place) as store:
        store.tenants.add(Tenant("farm"))
    with Store.open(place) as store:
        assert store.tenants.all() == [Tenant("farm")]


def test_what_is_not_there_is_refused(store: Store) -> None:
    """By its key."""
    with pytest.raises(RefusedError, match="no mission m9") as refused:
        store.missions.require("m9")
    assert refused.value.status == 404
    with pytest.raises(RefusedError, match="no mission m9"):
        store.missions.update("m9", lambda row: row)


def test_several_rows_are_kept_all_or_none(store: Store) -> None:
    """The second one names a tenant that there is not."""
    with pytest.raises(StoreError, match="must be there first"):
        store.leases.put(LEASE, replace(LEASE, id="l2", number=2, tenant="nobody"))
    assert store.leases.all() == []


def test_what_a_new_row_does_not_say_replaces_what_was_kept(store: Store) -> None:
    """Its defaults are as good as other values."""
    store.robots.put(RobotState("a", enabled=False, battery=0.5, position=(1.0, 2.0, 3.0)))
    store.robots.put(RobotState("a"))
    assert store.robots.require("a") == RobotState("a")
    store.robots.put(RobotState("a", battery=0.5))
    store.robots.update("a", lambda _: RobotState("a"))
    assert store.robots.require("a") == RobotState("a")


def test_a_row_that_was_read_changes_nothing_by_itself(store: Store) -> None:
    """It belongs to no transaction, whoever changes it later."""
    store.robots.add(RobotState("a", battery=0.5))
    row = store.robots.require("a")
    row.battery = 0.1
    store.robots.put(RobotState("b"))
    assert store.robots.require("a").battery == 0.5


def test_a_change_that_fails_changes_nothing(store: Store) -> None:
    """What it raises is raised."""
    store.robots.add(RobotState("a", battery=0.5))

    def refuse(_: RobotState) -> RobotState:
        raise RefusedError(409, "no")

    with pytest.raises(RefusedError, match="no"):
        store.robots.update("a", refuse)
    assert store.robots.require("a").battery == 0.5


def test_threads_and_programs_change_one_row_one_after_the_other(
    store: Store, place: str | Path
) -> None:
    """No change is lost; else a mission could begin twice."""
    store.leases.put(LEASE)
    store.missions.add(MISSION)
    store.usage.add(replace(USAGE, cloud_calls=0))
    errors: list[Exception] = []

    def count(by: Store) -> None:
        try:
            for _ in range(10):
                by.usage.update("m1", lambda row: replace(row, cloud_calls=row.cloud_calls + 1))
        except Exception as error:  # noqa: BLE001 - told below
            errors.append(error)

    with Store.open(place) as other:
        threads = [threading.Thread(target=count, args=[by]) for by in (store, other) * 4]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert not errors
    assert store.usage.require("m1").cloud_calls == 80


def test_lists_have_what_is_asked_for_in_order(store: Store) -> None:
    """Missions newest first, those that go on oldest first, leases in the queue's order."""
    store.tenants.add(Tenant("campus"))
    queued = replace(LEASE, state=LeaseState.QUEUED)
    store.leases.put(LEASE, replace(queued, id="l3", number=3), replace(queued, id="l2", number=2))
    assert [lease.id for lease in store.leases.live()] == ["l2", "l3"]
    assert store.leases.highest_number() == 3
    store.missions.put(
        MISSION,
        replace(MISSION, id="m2", submitted=6.0, phase=MissionPhase.FLYING),
        replace(MISSION, id="m3", submitted=7.0, tenant="campus"),
    )
    assert [one.id for one in store.missions.newest(9)] == ["m3", "m2", "m1"]
    assert [one.id for one in store.missions.newest(9, "farm")] == ["m2", "m1"]
    assert [one.id for one in store.missions.newest(1)] == ["m3"]
    store.missions.update("m2", lambda row: replace(row, phase=MissionPhase.LANDED))
    assert [one.id for one in store.missions.open()] == ["m1", "m3"]
    store.missions.update("m3", lambda row: replace(row, request={"share": ["farm", "x_y"]}))
    assert [one.id for one in store.missions.newest_shared(9, "farm")] == ["m3"]
    assert [one.id for one in store.missions.newest_shared(9, "campus")] == ["m2", "m1"]
    assert [one.id for one in store.missions.newest_shared(9, "xxy")] == []


def test_usage_is_summed_by_tenant_and_time(store: Store) -> None:
    """Recordings that are deleted take up no storage."""
    assert store.usage.total("farm", 0.0) == (0.0, 0)
    store.leases.put(LEASE)
    for number in range(4):
        store.missions.add(replace(MISSION, id=f"m{number}"))
        store.usage.add(
            Usage(
                f"m{number}",
                "farm",
                "pilot",
                float(number),
                flight_seconds=60.0,
                cloud_calls=1,
                recorded_bytes=2**33,
                kept=number != 2,
            )
        )
    assert store.usage.total("farm", 1.0) == (180.0, 3)
    assert store.usage.total("campus", 0.0) == (0.0, 0)
    assert store.usage.stored_bytes("farm") == 3 * 2**33
    assert [row.mission for row in store.usage.all("farm")] == ["m0", "m1", "m2", "m3"]
    assert store.usage.all("campus") == []


def test_audit_entries_are_numbered_and_the_oldest_go_first(store: Store) -> None:
    """Several at once, too."""
    entries = [AuditEntry(float(n), "pilot", "farm", "::1", f"a{n}", n % 2 == 0) for n in range(5)]
    last = store.audit.add(*entries)
    shown = store.audit.newest(9)
    assert [entry.action for entry in shown] == ["a4", "a3", "a2", "a1", "a0"]
    assert [replace(entry) for entry in reversed(shown)] == entries
    assert shown[0].number == last
    store.audit.trim(last - 1)
    assert [entry.action for entry in store.audit.newest(9)] == ["a4", "a3"]
