"""Hand-over of drones between the monitor and missions: never two that command, never nobody."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import pytest
from offered import PILOT, Link, Monitor, Provider

from aerodaas.errors import MissionError
from aerodaas.mission.commands import Answer
from aerodaas.protocol.schemas import (
    USUAL_SCOPES,
    FlightLeaseIn,
    LeaseIn,
    LinkState,
    MissionPhase,
    Role,
)
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import RefusedError
from aerodaas.service.mission import ActiveMission
from aerodaas.service.mission_service import MissionService
from aerodaas.service.models.model_store import ModelStore
from aerodaas.service.monitor.process import FleetMonitor
from aerodaas.service.monitor.reports import WatchedVehicle

OPERATOR = Principal("olga", "provider", Role.OPERATOR, frozenset(USUAL_SCOPES), "t")


@pytest.fixture
def provider(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Provider]:
    """A provider whose monitor is the test's."""
    made = Provider(tmp_path, monkeypatch)
    yield made
    made.close()


def test_a_flight_begins_once_the_monitor_has_let_go(provider: Provider) -> None:
    """Not before, and the monitor takes the drone back once the flight is over."""
    mission = provider.submit()
    provider.turns()
    assert provider.monitor.wanted == {"one", "two"}
    assert "the service connects to it" in provider.missions.shown(mission.id).reason
    provider.monitor.see("one")
    provider.turns()
    assert provider.monitor.wanted == {"two"}
    assert provider.phase(mission) is MissionPhase.QUEUED
    assert provider.started == []
    provider.monitor.held.remove("one")
    provider.turns()
    assert provider.phase(mission) is MissionPhase.FLYING
    assert len(provider.started) == 1
    provider.turns()
    assert provider.monitor.wanted == {"two"}
    assert provider.registry.report("one").link is LinkState.MISSION
    provider.land()
    provider.turns()
    assert provider.phase(mission) is MissionPhase.LANDED
    assert provider.monitor.wanted == {"one", "two"}


def test_one_that_somebody_arms_meanwhile_is_not_handed_over(provider: Provider) -> None:
    """The mission waits, and tells for what."""
    provider.monitor.see("one")
    mission = provider.submit()
    provider.turns()
    assert provider.monitor.wanted == {"two"}
    provider.monitor.see("one", mode="manual", objections=("already manual",))
    provider.turns()
    assert provider.monitor.wanted == {"one", "two"}
    assert provider.missions.shown(mission.id).reason == "waits for one: already manual"


@pytest.mark.parametrize(
    ("news", "said"),
    [
        (
            {"link": LinkState.LOST, "since": 1000.0, "reason": "no word"},
            "not reachable since 1970",
        ),
        ({"battery": 0.2}, "its battery holds 20%, and it comes home at 25%: charge it"),
        ({"objections": ("no fix", "hot")}, "no fix; hot"),
    ],
    ids=["unreachable", "low", "unhealthy"],
)
def test_what_cannot_fly_is_neither_leased_nor_submitted_to(
    provider: Provider, news: dict[str, Any], said: str
) -> None:
    """With the reason, which the catalogue has, too; another one can be had."""
    provider.monitor.see("one", **news)
    provider.monitor.see("two")
    for ask in (provider.submit, lambda: provider.leases.request(PILOT, wish("one"))):
        with pytest.raises(RefusedError, match=r"^one: ") as refused:
            ask()
        assert refused.value.status == 409
        assert said in refused.value.text
    one, two = provider.fleet.seen_by(PILOT).robots
    assert said in one.objection
    assert (two.objection, two.link, two.battery) == ("", LinkState.CONNECTED, 0.9)
    any_one = provider.leases.request(PILOT, wish())
    assert any_one.robots == ("two",)


def wish(*robots: str) -> LeaseIn:
    """A request of these drones, or of any one."""
    return LeaseIn(robots=list(robots) or None)


def test_a_dropout_of_a_moment_refuses_nobody(provider: Provider) -> None:
    """Radio links have them; the mission waits until it is over."""
    provider.monitor.see("one", link=LinkState.LOST, since=time.time())
    mission = provider.submit()
    provider.turns()
    assert "the service connects to it" in provider.missions.shown(mission.id).reason
    assert provider.monitor.wanted == {"one", "two"}


def test_one_that_is_not_known_to_be_down_is_nobodys(provider: Provider) -> None:
    """Its actor may fly it still: neither the monitor nor a mission connects before a look."""
    provider.monitor.see("one")
    mission = provider.submit()
    provider.turns()
    provider.monitor.held.clear()
    provider.turns()
    provider.land(state="aborted", mode="manual")
    provider.turns()
    assert "not known to be down" in provider.missions.shown(mission.id).reason
    assert provider.monitor.wanted == {"two"}
    with pytest.raises(RefusedError, match="out of service until an operator has looked"):
        provider.submit()
    provider.registry.enable("one", enabled=True)
    provider.turns()
    assert provider.monitor.wanted == {"one", "two"}


def test_drones_in_flight_are_left_alone_after_a_restart(
    provider: Provider, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A new service finds them in the database before it lets the monitor hold anything."""
    provider.monitor.see("one")
    provider.submit()
    provider.turns()
    provider.monitor.held.clear()
    provider.turns()
    assert len(provider.started) == 1
    seen: list[set[str]] = []
    monitor = Monitor(provider.registry)
    monkeypatch.setattr(monitor, "hold", lambda robots: seen.append(set(robots)))
    again = MissionService(
        provider.settings,
        provider.store,
        leases=provider.leases,
        registry=provider.registry,
        models=ModelStore(provider.settings.models),
        monitor=cast("FleetMonitor", monitor),
    )
    again.advance()
    again.close()
    assert seen == [{"two"}]


def test_news_of_the_ground_do_not_hide_a_mission(provider: Provider) -> None:
    """The monitor tells of all drones, those that it does not hold included."""
    provider.registry.set_link(["one"], LinkState.MISSION)
    provider.registry.record_reports({"one": WatchedVehicle(), "two": WatchedVehicle()})
    assert provider.registry.report("one").link is LinkState.MISSION
    provider.registry.record_reports({})
    assert provider.registry.report("one").link is LinkState.MISSION
    assert provider.registry.report("two").reason == "the service looks for it again"


class Launching(Link):
    """A flight whose process does not listen yet."""

    def change_lease(self, lease: FlightLeaseIn) -> Answer:
        """Note what is asked; answer once it has told its state."""
        super().change_lease(lease)
        if not self.number:
            raise MissionError("the flight's process does not answer")
        return Answer(accepted=True)


@pytest.fixture
def launching(provider: Provider) -> tuple[Launching, str]:
    """A flight that is being launched, and its lease."""
    mission = provider.flying()
    link = Launching()
    link.number = 0
    provider.missions._missions[mission.id].link = cast("Any", link)
    lease = provider.missions.shown(mission.id).lease
    assert lease is not None
    return link, lease


def test_a_lease_revoked_during_the_launch_brings_the_drone_home(
    provider: Provider, launching: tuple[Launching, str]
) -> None:
    """The flight is told once it listens, and once only; while it hangs nobody waits for it."""
    link, lease = launching
    provider.leases.end(OPERATOR, lease)
    told = FlightLeaseIn(reason="the lease has ended: revoked by olga")
    provider.turns()
    assert link.asked == [told]
    link.number = 1
    provider.turns()
    assert link.asked == [told, told]


def test_a_lease_extended_during_the_launch_ends_later(
    provider: Provider, launching: tuple[Launching, str]
) -> None:
    """As its user was told."""
    link, lease = launching
    ends = provider.leases.extend(PILOT, lease, 5.0).ends
    link.number = 1
    provider.turns()
    assert link.asked == [FlightLeaseIn(ends=ends)] * 2


def test_what_became_of_a_lease_is_told_by_the_next_service(
    provider: Provider, launching: tuple[Launching, str]
) -> None:
    """Where the one before ended in between."""
    _, lease = launching
    provider.leases.end(OPERATOR, lease)
    (mission,) = provider.missions._missions.values()
    again = ActiveMission(mission.row, Path(mission.row.folder), provider.store.missions.put)
    link = again.link = cast("Any", Link())
    provider.missions._missions[mission.row.id] = again
    provider.turns()
    assert link.asked == [FlightLeaseIn(reason="the lease has ended: revoked by olga")]
