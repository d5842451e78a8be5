"""Where our other drones are taken to be, and what is kept from one that has fallen silent."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from flights import KinematicVehicle
from hypothesis import example, given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.config.sections.robot import LimitsConfig
from aerodaas.messages.vehicle import PositionSetpoint, VehicleMode, VehicleState, VelocitySetpoint
from aerodaas.mission.safety.neighbours import SILENT, Neighbours, Whereabouts
from aerodaas.mission.safety.setpoint_filter import SetpointFilter

_SECOND = NANOSECONDS
_SILENT_NS = round(SILENT * NANOSECONDS)
_EAST = np.array([2.0, 0.0, 0.0])


def _where(*, stamp: int = 0, flying: bool = True) -> Whereabouts:
    return Whereabouts(stamp, np.array([5.0, 0.0, 10.0]), _EAST, flying)


def _known(**told: Whereabouts) -> Neighbours:
    known = Neighbours()
    for name, where in told.items():
        known.update(name, where)
    return known


@given(st.integers(-_SECOND, 100 * _SECOND))
@example(_SILENT_NS)
def test_a_drone_is_where_its_velocity_has_taken_it_by_now(now: int) -> None:
    """At most as far as it may be believed; a stamp of the future is no way back."""
    (other,) = _known(east=_where()).around("west", now, 3.0)
    flown = min(max(0, now) / _SECOND, SILENT)
    assert other.position == pytest.approx([5.0 + 2.0 * flown, 0.0, 10.0])
    assert other.limit == "separation"
    assert (other.apart is None) == (now <= _SILENT_NS)


def test_who_is_silent_is_not_believed_to_brake() -> None:
    """One nanosecond more than the time is silence; who tells again is believed again."""
    known = _known(east=_where())
    assert known.newly_silent(_SILENT_NS, ()) == []
    assert known.newly_silent(_SILENT_NS + 1, ()) == ["east"]
    assert known.newly_silent(_SILENT_NS + 2, ()) == [], "each silence is told once"
    (other,) = known.around("west", _SILENT_NS + 1, 3.0)
    assert other.apart == (3.0, 3.0)
    known.update("east", _where(stamp=_SILENT_NS))
    assert known.newly_silent(_SILENT_NS + 2, ()) == []
    (other,) = known.around("west", _SILENT_NS + 2, 3.0)
    assert other.apart is None
    assert known.newly_silent(3 * _SILENT_NS, ()) == ["east"], "the next silence is another one"


def test_a_drones_own_actor_tells_of_it_otherwise() -> None:
    """Its lost link has an alert of its own; others are kept from it all the same."""
    known = _known(east=_where(), west=_where())
    assert known.newly_silent(2 * _SILENT_NS, ("east",)) == ["west"]
    (east,) = known.around("west", 2 * _SILENT_NS, 3.0)
    assert east.apart == (3.0, 3.0)


def test_who_has_landed_may_be_silent() -> None:
    """It is in the way where it stands, for as long as it stands there."""
    known = _known(east=_where(flying=False))
    (other,) = known.around("west", 3600 * _SECOND, 3.0)
    assert other.position == pytest.approx([5.0, 0.0, 10.0])
    assert other.apart is None
    assert known.newly_silent(3600 * _SECOND, ()) == []


def test_each_drone_asks_for_itself_at_one_moment() -> None:
    """What was told in between, and another's distance, count at once; time goes on for all."""
    known, now = _known(east=_where()), 2 * _SILENT_NS
    assert [one.apart for one in known.around("west", now, 3.0)] == [(3.0, 3.0)]
    assert [one.apart for one in known.around("north", now, 5.0)] == [(5.0, 5.0)]
    known.update("east", _where(stamp=now))
    (other,) = known.around("north", now, 5.0)
    assert other.apart is None
    assert other.position == pytest.approx([5.0, 0.0, 10.0])
    (other,) = known.around("west", now + _SECOND // 2, 3.0)
    assert other.position == pytest.approx([6.0, 0.0, 10.0])


def test_nobody_is_near_himself_or_without_a_separation() -> None:
    """A drone has no neighbour in itself, and where no distance is set there are none."""
    known = _known(east=_where(), west=_where())
    assert len(known.around("west", 0, 3.0)) == 1
    assert known.around("west", 5 * _SECOND, 0.0) == []
    assert set(known.of(["east", "south"])) == {"east"}


@pytest.mark.parametrize("part", ["position", "velocity"])
def test_a_place_that_is_none_leaves_the_last(part: Literal["position", "velocity"]) -> None:
    """A drone whose estimate is lost is not gone: its age tells that nothing is known anew."""
    state: VehicleState = KinematicVehicle((0.0, 0.0, 5.0)).read()
    nowhere = np.array([math.nan, 0.0, 0.0])
    broken = replace(state.odometry, position=nowhere)
    if part == "velocity":
        broken = replace(state.odometry, velocity=nowhere)
    where = Whereabouts.of(replace(state, odometry=broken))
    known = _known(east=_where())
    assert where is None
    known.update("east", where)
    (other,) = known.around("west", 2 * _SILENT_NS, 3.0)
    assert other.apart is not None
    assert known.newly_silent(2 * _SILENT_NS, ()) == ["east"]


@pytest.mark.parametrize("lost", [1.0, 2.0, 2.5, 3.0])
def test_a_drone_whose_companion_dies_is_not_flown_into(lost: float) -> None:
    """Head on at 4 m/s each, one of them tells nothing any more, and hovers half a second later."""
    limits = LimitsConfig(separation=3.0, max_speed=4.0)
    homes = [np.array([0.0, 0.0, 0.0]), np.array([30.0, 0.0, 0.0])]
    guards = [SetpointFilter(limits, home) for home in homes]
    drones = [KinematicVehicle((0.0, 0.0, 5.0)), KinematicVehicle((30.0, 1.0, 5.0))]
    for drone in drones:
        drone.mode = VehicleMode.GUIDED
    known = Neighbours()
    now, nearest, names = 0, math.inf, set[str]()
    for _ in range(300):
        states = [drone.read() for drone in drones]
        for me, name in enumerate(("west", "east")):
            if me == 1 and now >= lost * NANOSECONDS:
                if now > (lost + 0.5) * NANOSECONDS:
                    drones[me].send(VelocitySetpoint(np.zeros(3)))
                continue
            odometry = states[me].odometry
            known.update(name, Whereabouts(now, odometry.position, odometry.velocity, flying=True))
            asked = PositionSetpoint(states[1 - me].odometry.position, None, 4.0)
            others = known.around(name, now, limits.separation)
            clamped = guards[me].clamp(asked, odometry, 0.05, others)
            drones[me].send(clamped.setpoint)
            names |= set(clamped.clipped_by)
        now += NANOSECONDS // 20
        for drone in drones:
            drone.advance_to(now)
        nearest = min(nearest, float(np.linalg.norm(drones[0].position - drones[1].position)))
    assert nearest > 2.9
    assert "separation" in names
    assert "traffic" not in names
