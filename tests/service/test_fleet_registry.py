"""The registry says of a drone what is known of it now, and since when it is known no more."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from offered import PILOT, Provider
from robot_statuses import robot_status

from aerodaas.errors import MissionError
from aerodaas.messages.health import HealthItem, HealthReport, Verdict
from aerodaas.messages.mission import MissionState, RobotStatus
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.protocol.schemas import LeaseIn, LeaseState, LinkState, RobotOut, Role
from aerodaas.service.errors import RefusedError
from aerodaas.service.fleet import fleet_registry as garages

T0 = 1_800_000_000.0
"""Unix seconds."""


class Clock:
    """Time as a test wants it."""

    now = T0


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """Of the registry."""
    clock = Clock()
    functions = {name: getattr(time, name) for name in ("strftime", "gmtime")}
    moments = dict.fromkeys(("time", "monotonic"), lambda: clock.now)
    monkeypatch.setattr(garages, "time", SimpleNamespace(**moments, **functions))
    return clock


@pytest.fixture
def provider(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Provider]:
    """Two drones."""
    made = Provider(tmp_path, monkeypatch)
    yield made
    made.missions.close()


def status(at: float, **changes: Any) -> dict[str, RobotStatus]:  # noqa: ANN401 - its fields
    """What a mission tells of drone `one` at its own time."""
    return {"one": robot_status(at, **{"battery": 0.7, **changes})}


def seen(provider: Provider) -> RobotOut:
    """Drone `one` of the fleet."""
    return next(one for one in provider.fleet.seen_by(PILOT).robots if one.id == "one")


def test_a_status_that_stands_still_is_no_news(provider: Provider, clock: Clock) -> None:
    """A flight that hangs: lost since its last word, and nothing of it is as of now."""
    provider.registry.set_link(["one"], LinkState.MISSION)
    provider.registry.record_status(status(10.0))
    assert (seen(provider).link, seen(provider).heard) == (LinkState.MISSION, T0)
    clock.now = T0 + 4.0
    provider.registry.record_status(status(10.0))
    assert (seen(provider).link, seen(provider).heard) == (LinkState.MISSION, T0)
    clock.now = T0 + 60.0
    provider.registry.record_status(status(10.0))
    silent = seen(provider)
    assert (silent.link, silent.since, silent.heard) == (LinkState.LOST, T0, T0)
    assert silent.faults == ["its mission has told nothing since 2027-01-15 08:00:00 UTC"]
    provider.registry.record_status(status(10.1))
    again = seen(provider)
    assert (again.link, again.heard, again.faults) == (LinkState.MISSION, T0 + 60.0, [])


def test_the_next_mission_is_not_the_last_one(provider: Provider, clock: Clock) -> None:
    """Its clock may show the same time."""
    provider.registry.record_status(status(10.0))
    clock.now = T0 + 60.0
    provider.registry.set_link(["one"], LinkState.MISSION)
    provider.registry.record_status(status(10.0))
    assert seen(provider).link is LinkState.MISSION


def test_a_mission_that_is_over_may_be_silent(provider: Provider, clock: Clock) -> None:
    """Its drone stands, while the recording is closed and the report drawn."""
    provider.registry.record_status(status(10.0, state="landed", mode="grounded"))
    clock.now = T0 + 60.0
    provider.registry.record_status(status(10.0, state="landed", mode="grounded"))
    assert (seen(provider).link, seen(provider).heard) == (LinkState.MISSION, T0)


def test_what_a_lost_vehicle_said_is_not_as_of_now(provider: Provider, clock: Clock) -> None:
    """Its mission goes on, and has no word from it: charge and place are those of before."""
    provider.registry.record_status(status(10.0))
    clock.now = T0 + 30.0
    provider.registry.record_status(status(40.0, mode="lost"))
    lost = seen(provider)
    assert (lost.link, lost.heard) == (LinkState.LOST, T0)


def test_the_end_of_a_flight_is_of_its_own_time(provider: Provider, clock: Clock) -> None:
    """Also where the service was away meanwhile."""
    clock.now = T0 + 3600.0
    provider.registry.record_status(
        status(90.0, state=MissionState.LANDED, mode=VehicleMode.GROUNDED, battery=0.4), ended=T0
    )
    assert (seen(provider).battery, seen(provider).heard) == (0.4, T0)


def test_a_charge_that_nobody_knows_lasts_for_no_minute(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lease with charge for so long waits until a drone is known to have it."""
    provider = Provider(tmp_path, monkeypatch, drone={"driver": "tello", "settings": {}})
    lease = provider.leases.request(PILOT, LeaseIn(battery_minutes=1.0, minutes=5.0))
    assert lease.state is LeaseState.QUEUED
    provider.monitor.see("two", battery=0.9)
    provider.leases.advance()
    granted = provider.leases.lease(lease.id)
    assert (granted.state, granted.robots) == (LeaseState.GRANTED, ("two",))
    provider.missions.close()


@pytest.mark.parametrize(("battery", "state"), [(1.0, "granted"), (0.31, "queued")])
def test_a_simulated_drone_has_its_settings_charge_before_it_flies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, battery: float, state: str
) -> None:
    """Nobody watches it between missions."""
    provider = Provider(tmp_path, monkeypatch, drone={"settings": {"battery": battery}})
    lease = provider.leases.request(PILOT, LeaseIn(battery_minutes=2.0, minutes=5.0))
    assert lease.state.value == state
    provider.missions.close()


def test_a_leases_area_is_shown_to_who_sees_the_lease(provider: Provider) -> None:
    """To its own tenant and to operators: where others mean to fly is not everybody's business."""
    area = [(0.0, 0.0), (9.0, 0.0), (9.0, 9.0)]
    assert seen(provider).area is None
    provider.monitor.see("one")
    provider.leases.request(PILOT, LeaseIn(robots=["one"], area=area))
    assert seen(provider).area == area
    operator = replace(PILOT, account="olga", tenant="provider", role=Role.OPERATOR)
    stranger = replace(PILOT, account="bela", tenant="city")
    for who, shown in ((operator, area), (stranger, None)):
        robots = {one.id: one for one in provider.fleet.seen_by(who).robots}
        assert robots["one"].area == shown
        assert robots["one"].lease is not None
        assert robots["two"].area is None


WINDY = HealthItem("wind", "12.0 m/s", "at most 10", Verdict.REFUSED, "wait for less wind")


def test_the_list_before_take_off_is_told_with_its_age(provider: Provider, clock: Clock) -> None:
    """In one word with the fleet, while somebody is connected with the drone on the ground."""
    assert provider.registry.preflight("one") == HealthReport()
    provider.monitor.see("one", health=(WINDY,), examined=T0)
    clock.now = T0 + 2.0
    told = provider.registry.preflight("one")
    assert (told.verdict, told.age, told.items) == (Verdict.REFUSED, 2.0, (WINDY,))
    assert seen(provider).preflight is Verdict.REFUSED
    provider.monitor.see("one", health=(WINDY,), examined=T0, link=LinkState.LOST, since=T0)
    clock.now = T0 + 60.0
    assert provider.registry.preflight("one").age == 60.0
    assert seen(provider).preflight is None
    with pytest.raises(RefusedError, match="there is no robot three"):
        provider.registry.preflight("three")


def test_a_missions_drone_has_the_list_that_its_flight_went_through(
    provider: Provider, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which is asked for it; of one that does not answer there is none."""
    mission = provider.flying()
    provider.monitor.see("one", health=(WINDY,), examined=T0)
    provider.registry.set_link(["one"], LinkState.MISSION)
    link = provider.missions._missions[mission.id].link
    well = HealthItem("wind", "2.0 m/s", "at most 10", Verdict.GOOD)
    told = HealthReport((well,), 4.0)
    monkeypatch.setattr(link, "preflight", lambda _: told, raising=False)
    assert provider.fleet.preflight("one") == told
    assert seen(provider).preflight is None

    def silent(_: str) -> HealthReport:
        raise MissionError("it does not answer")

    monkeypatch.setattr(link, "preflight", silent)
    assert provider.fleet.preflight("one") == HealthReport()
