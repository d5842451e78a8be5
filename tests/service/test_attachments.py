"""Missions that sense by another one's cameras: only where the provider and its owner agree."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import pytest
from offered import PILOT, Link, Provider

from aerodaas.protocol.schemas import (
    USUAL_SCOPES,
    FlightLeaseIn,
    MissionIn,
    MissionOut,
    MissionPhase,
    Role,
    Scope,
)
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import RefusedError
from aerodaas.service.flights.orders import FlightOrder, Outcome
from aerodaas.service.store import Account, Tenant

CITY = Principal("bela", "city", Role.PILOT, frozenset({Scope.SENSE, Scope.COMPUTE}), "t")
GRANT = {"city": ["one/cam"]}


@pytest.fixture
def provider(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Provider]:
    """A provider that lets two missions share a flight's cameras, with a second tenant."""
    made = Provider(tmp_path, monkeypatch, most_attached=2)
    made.store.tenants.add(Tenant("city"))
    made.store.accounts.add(Account("bela", "city", Role.PILOT, CITY.scopes, 0.0))
    yield made
    made.close()


def watching(host: str, **changes: object) -> MissionIn:
    """A mission that looks for people in one camera's pictures."""
    found = {"id": "one/people", "analysis": "OnnxDetector", "reads": ["one/cam"]}
    document = {"format": "aerodaas-mission", "version": 1, "sensors": ["one/cam"]}
    document |= {"analyses": [found], **changes}
    return MissionIn.model_validate({"document": document, "attach": host})


def attached(provider: Provider, host: MissionOut, who: Principal = CITY) -> MissionOut:
    """Attach a mission, and have it run."""
    mission = provider.missions.submit(who, watching(host.id))
    provider.turns(3)
    assert provider.phase(mission) is MissionPhase.FLYING
    provider.missions._missions[mission.id].link = cast("Any", Link())
    return mission


def asked(provider: Provider, mission: MissionOut) -> list[Any]:
    """What a mission's flight was asked."""
    return list(cast("Link", provider.missions._missions[mission.id].link).asked)


def test_who_is_granted_senses_beside_the_flight(provider: Provider) -> None:
    """In a process of its own, without a drone, by what was granted alone."""
    host = provider.flying(grants=GRANT)
    mission = attached(provider, host)
    assert ("share", mission.id, ["one/cam"]) in asked(provider, host)
    order = FlightOrder.read(provider.started[-1].order)
    assert order.robots == []
    assert order.attached is not None
    assert (order.attached.mission, order.attached.sensors) == (host.id, ["one/cam"])
    shown = provider.missions.mission(CITY, mission.id)
    assert (shown.attach, shown.robots, shown.lease) == (host.id, [], None)
    (one, _) = provider.fleet.seen_by(CITY).robots
    assert (one.mission, one.shared) == (host.id, ["one/cam"])
    for who in (PILOT, Principal("eve", "evil", Role.PILOT, frozenset(USUAL_SCOPES), "t")):
        with pytest.raises(RefusedError, match="there is no mission"):
            provider.missions.mission(who, mission.id)


def test_a_granted_tenant_neither_watches_nor_commands_the_flight(provider: Provider) -> None:
    """A grant is for cameras in flight: not for the mission, its state or its recording."""
    host = provider.flying(grants=GRANT)
    with pytest.raises(RefusedError, match="there is no mission"):
        provider.missions.mission(CITY, host.id)
    with pytest.raises(RefusedError, match="there is no mission"):
        provider.missions.grant(CITY, host.id, "evil", [])


@pytest.mark.parametrize(
    ("grants", "share", "status", "told"),
    [
        ({}, [], 404, "there is no mission"),
        ({"others": []}, [], 404, "there is no mission"),
        ({}, ["city"], 403, "farm has not granted"),
        ({"city": ["one/belly"]}, [], 403, "does not share one/cam; it shares one/belly"),
    ],
)
def test_without_a_grant_nothing_is_attached(
    provider: Provider, grants: object, share: object, status: int, told: str
) -> None:
    """To a stranger the flight does not exist; who may watch it may not attach to it."""
    host = provider.flying(grants=grants, share=share)
    with pytest.raises(RefusedError, match=told) as refused:
        provider.missions.submit(CITY, watching(host.id))
    assert refused.value.status == status
    assert asked(provider, host) == []


def test_without_the_providers_consent_nothing_is_attached(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the owner grants, and to the owner itself."""
    provider = Provider(tmp_path, monkeypatch)
    host = provider.flying(grants=GRANT)
    for who in (CITY, PILOT):
        with pytest.raises(RefusedError, match="shares no cameras between applications"):
            provider.missions.submit(who, watching(host.id))
    assert provider.fleet.seen_by(CITY).robots[0].shared == []
    provider.close()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"navigation": [{"robot": "one"}]}, "senses only, and this one navigates one"),
        (
            {
                "analyses": [
                    {
                        "id": "one/people",
                        "analysis": "OnnxDetector",
                        "reads": ["one/cam"],
                        "triggers": [{"target": "one", "command": "end_mission"}],
                    }
                ]
            },
            "one/people would command the drone by end_mission",
        ),
        (
            {
                "analyses": [
                    {"id": "one/r", "analysis": "RemoteAnalytics", "reads": ["one/cam"]},
                ]
            },
            "one/r would command the drone by its RemoteAnalytics",
        ),
        ({"sensors": ["two/cam"]}, "does not share two/cam"),
        ({"sensors": ["one/odometry"]}, "does not share one/odometry"),
        ({"sensors": [], "analyses": []}, "reads at least one camera"),
    ],
    ids=["navigates", "triggers", "commands", "foreign robot", "no camera", "nothing"],
)
def test_what_would_change_a_target_or_read_another_is_refused(
    provider: Provider, changes: dict[str, Any], told: str
) -> None:
    """Before anything of it runs."""
    host = provider.flying(grants={"city": []})
    with pytest.raises(RefusedError, match=told):
        provider.missions.submit(CITY, watching(host.id, **changes))


def test_an_attached_mission_takes_no_command(provider: Provider) -> None:
    """Nor does it lead to another one that does."""
    from aerodaas.protocol.schemas import CommandIn  # noqa: PLC0415 - a request

    host = provider.flying(grants=GRANT)
    mission = attached(provider, host)
    with pytest.raises(RefusedError, match=f"attached to {host.id}: it senses only") as refused:
        provider.missions.fly(CITY, mission.id, CommandIn(robot="one", command="land"))
    assert refused.value.status == 403
    with pytest.raises(RefusedError, match="there is no mission"):
        provider.missions.fly(CITY, host.id, CommandIn(robot="one", command="land"))
    with pytest.raises(RefusedError, match="senses only: attach to a mission in flight"):
        provider.missions.submit(CITY, watching(mission.id))
    assert all(one[0] in {"share", "withdraw"} for one in asked(provider, host))


def test_a_withdrawn_grant_ends_what_was_attached(provider: Provider) -> None:
    """At the flight first, then by a word to the mission; other tenants' go on."""
    host = provider.flying(grants=GRANT)
    mission, own = attached(provider, host), attached(provider, host, PILOT)
    provider.missions.grant(PILOT, host.id, "city", None)
    assert ("withdraw", mission.id) in asked(provider, host)
    assert asked(provider, mission) == [FlightLeaseIn(reason="farm has withdrawn its grant")]
    assert asked(provider, own) == []
    with pytest.raises(RefusedError, match="there is no mission"):
        provider.missions.submit(CITY, watching(host.id))
    assert provider.missions.mission(PILOT, host.id).grants == {}


def test_a_narrower_grant_ends_what_it_leaves_out(provider: Provider) -> None:
    """And lets the rest go on."""
    host = provider.flying(grants={"city": []})
    mission = attached(provider, host)
    provider.missions.grant(PILOT, host.id, "city", ["one/cam"])
    assert asked(provider, mission) == []
    provider.missions.grant(PILOT, host.id, "city", ["one/belly"])
    assert ("withdraw", mission.id) in asked(provider, host)


def test_an_attached_mission_ends_with_its_flight(provider: Provider) -> None:
    """And its own end shares no more with it; no drone goes out of service by it."""
    host = provider.flying(grants=GRANT)
    mission = attached(provider, host)
    process = provider.started[-1]
    provider.started.pop()
    provider.land()
    provider.turns()
    assert provider.phase(host) is MissionPhase.LANDED
    (told,) = asked(provider, mission)
    assert told.ends is None
    with pytest.raises(RefusedError, match="there is no mission"):
        provider.missions.submit(CITY, watching(host.id))
    process.end(Outcome(landed=True, began=0.0, ended=1.0, reason="over"))
    provider.turns()
    assert provider.phase(mission) is MissionPhase.LANDED
    assert all(one.enabled for one in provider.registry.states.values())


def test_after_the_leases_end_nothing_is_attached(provider: Provider) -> None:
    """Though the drone is still on its way home."""
    host = provider.flying(grants=GRANT)
    lease = provider.missions.mission(PILOT, host.id).lease
    provider.leases.end(PILOT, str(lease))
    with pytest.raises(RefusedError, match="its lease has ended") as refused:
        provider.missions.submit(CITY, watching(host.id))
    assert refused.value.status == 409


def test_no_more_are_attached_than_the_provider_allows(provider: Provider) -> None:
    """Two, here; the next one when one has gone."""
    host = provider.flying(grants=GRANT)
    first, _ = attached(provider, host), attached(provider, host)
    with pytest.raises(RefusedError, match="the most that may be"):
        provider.missions.submit(CITY, watching(host.id))
    provider.missions.cancel(CITY, first.id)
    provider.started[-2].end(Outcome(landed=True, began=0.0, ended=1.0, reason="cancelled by x"))
    provider.turns()
    assert provider.phase(first) is MissionPhase.CANCELLED
    attached(provider, host)


def test_a_mission_without_navigation_is_attached_or_refused(provider: Provider) -> None:
    """By a sentence; it would fly nothing."""
    wanted = watching("x").model_copy(update={"attach": None})
    with pytest.raises(RefusedError, match="it flies no drone, and is attached to no mission"):
        provider.missions.submit(PILOT, wanted)
