"""What a mission says of its battery ahead agrees with what it does when that comes."""

from __future__ import annotations

import pytest
from flights import Flight, KinematicVehicle, add, flight

from aerodaas.config.model import LimitsConfig, MissionConfig
from aerodaas.messages.mission import BatteryOutlook
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import Pause, ReturnHome

_LIMITS = LimitsConfig(endurance=300.0, battery_return=0.15, battery_land=0.1)


def outlook_of(one: Flight) -> BatteryOutlook:
    """What is said of the battery, which is known."""
    assert one.status.outlook is not None
    return one.status.outlook


def hovering(east: float, north: float, charge: float = 1.0, drain: float = 0.0) -> Flight:
    """A flight that stands still over a place; drain is relative to the data sheet's."""
    one = flight(
        add(Waypoint("there", east, north, 2.0)),
        limits=_LIMITS,
        options=MissionConfig(on_complete="hold"),
        vehicle=KinematicVehicle(charge=charge, drain=drain / _LIMITS.endurance),
    )
    one.run(until=lambda: "there" in one.status.visited)
    one.run(2.0)
    one.expect(S.HOLDING)
    return one


@pytest.mark.parametrize(("east", "north"), [(4, -3), (-15, 10)])
def test_the_drone_returns_at_the_charge_that_is_said(east: int, north: int) -> None:
    """Near home the configured charge counts, farther away what the way home takes."""
    one = hovering(east, north, charge=0.4, drain=1.0)
    said = outlook_of(one)
    while one.mission.state is S.HOLDING:
        said = outlook_of(one)
        one.turn()
    one.expect(S.RETURNING)
    a_second = 1.0 / _LIMITS.endurance
    assert one.vehicle.charge == pytest.approx(said.returns_at, abs=1.1 * a_second)
    assert said.hover == pytest.approx(0.0, abs=1.1)
    assert (said.returns_at == _LIMITS.battery_return) is (abs(east) < 10)


def test_it_hovers_as_long_as_is_said() -> None:
    """A battery that drains as its data sheet says, and one that is worse by half."""
    for drain in (1.0, 1.5):
        one = hovering(5, 0, charge=0.4, drain=drain)
        said, since = outlook_of(one).hover, one.seconds
        one.run_to(S.RETURNING)
        assert one.seconds - since == pytest.approx(said, abs=6.0)


def test_a_plan_needs_what_its_flight_takes() -> None:
    """With the way home, and the reserve that a landing is begun with."""
    long = flight(add(Waypoint("far", 40, 0, 2.0, hover_duration=60.0)), limits=_LIMITS)
    long.run_to(S.ENROUTE)
    hover, reserve = 60.0 / _LIMITS.endurance, _LIMITS.battery_land
    ways = 80.0 / _LIMITS.cruise_speed / _LIMITS.endurance
    assert outlook_of(long).plan == pytest.approx(hover + ways + reserve, abs=0.05)
    assert outlook_of(hovering(0, 0)).plan == pytest.approx(reserve, abs=0.02)


def test_nothing_is_said_that_is_not_known() -> None:
    """Without a place, on the way home, on the ground: no old figure stays."""
    one = hovering(5, 0)
    one.tell(Pause())
    one.run(4.0)
    assert one.mission.state is S.PAUSED
    outlook_of(one)
    one.vehicle.blind = True
    one.run(4.0)
    assert one.status.outlook is None
    one = hovering(15, 0)
    one.tell(ReturnHome())
    one.run(4.0)
    one.expect(S.RETURNING)
    assert one.status.outlook is None
