"""A pilot takes over a real autopilot unheard, or during take-off: nobody overrides."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import AddNavigation, HandOver
from sitl.autopilot import Autopilot
from sitl.flights import FAR, SitlFlight

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(900), pytest.mark.wall_clock]

PILOTS = {
    "hold": {"ardupilot": (5.0,), "px4": (4.0, 3.0)},
    "land": {"ardupilot": (9.0,), "px4": (4.0, 6.0)},
    "altitude hold": {"ardupilot": (2.0,), "px4": (2.0,)},
}
"""Modes that a pilot chooses: what DO_SET_MODE takes after its first parameter."""
LAND = PILOTS["land"]
FLIGHTS = 5


def choose(flight: SitlFlight, family: str, modes: dict[str, tuple[float, ...]]) -> None:
    """Have a pilot choose a mode; it goes past the link that is cut."""
    flight.command_as_station(mavlink.MAV_CMD_DO_SET_MODE, 1.0, *modes[family])


def end(flight: SitlFlight, family: str) -> None:
    """Have the pilot land it, for the next flight."""
    choose(flight, family, LAND)
    flight.wait_for_ground()


@pytest.mark.parametrize("name", PILOTS)
def test_a_pilot_who_takes_over_in_a_cut_of_the_link(autopilot: Autopilot, name: str) -> None:
    """Six seconds of silence, the pilot in the middle, five times; the mode stays the pilot's."""
    for _ in range(FLIGHTS):
        with SitlFlight(autopilot.url, FAR, takeoff_height=8.0) as flight:
            witness = flight.relay.witness
            flight.run_to(S.ENROUTE)
            flight.run(4.0)
            flight.relay.cut()
            flight.run(3.0)
            choose(flight, autopilot.family, PILOTS[name])
            flight.run(3.0)
            chosen, known = witness.modes[-1], len(witness.modes)
            flight.relay.cut(off=False)
            flight.run(3.0, lambda: flight.mission.finished)
            flight.tell_outcome(f"a pilot's {name} in a cut of the link")
            assert flight.mission.state is S.ABORTED, flight.story
            assert flight.status.reason.startswith(
                ("a pilot has taken over", "the vehicle's own protection has taken over")
            )
            flight.vehicle.close()
            # PX4 leaves a mode that needs sticks, by its own protection.
            ours = {"ardupilot": 4, "px4": 6 << 16}[autopilot.family]
            assert ours not in witness.modes[known:]
            assert name == "altitude hold" or witness.modes[known - 1 :] == [chosen]
            flight.vehicle.connect(30.0)
            end(flight, autopilot.family)


@pytest.mark.parametrize("name", ["hold", "land"])
def test_a_pilot_who_takes_over_during_the_take_off(autopilot: Autopilot, name: str) -> None:
    """Half way up to 10 m: within moments the mission is over, and the mode stays the pilot's."""
    with SitlFlight(autopilot.url, FAR, takeoff_height=10.0) as flight:
        witness = flight.relay.witness
        flight.run_to(S.TAKING_OFF)
        flight.run(60.0, lambda: witness.highest > 5.0)
        choose(flight, autopilot.family, PILOTS[name])
        flight.run(4.0)
        flight.tell_outcome(f"a pilot's {name} during the take-off")
        assert flight.mission.state is S.ABORTED, flight.story
        assert flight.status.reason == "a pilot has taken over"
        chosen = witness.modes[-1]
        assert witness.highest < 9.0
        flight.vehicle.close()
        assert witness.modes[-1] == chosen


@pytest.mark.parametrize("moved", [(25.0, 0.0), (0.0, 8.0), (0.0, -8.0), (4.0, 0.0)])
def test_a_home_that_is_moved_in_flight(autopilot: Autopilot, moved: tuple[float, float]) -> None:
    """Handed over, 8 m up: it stays there, and within two seconds that is told and taken back."""
    stops = [Waypoint("a", 0, 60, 8), Waypoint("b", 20, 60, 8)]
    order = AddNavigation(AeroNavigation(data=stops))
    east, up = moved
    with SitlFlight(autopilot.url, order, takeoff_height=8.0) as flight:
        witness = flight.relay.witness
        flight.run_to(S.ENROUTE)
        assert flight.tell(HandOver()).accepted
        flight.run(20.0, lambda: flight.mission.handover.flies)
        flight.run(3.0)
        vehicle = flight.vehicle
        latitude, longitude, _ = vehicle.connection.alignment.origin.to_geodetic(
            np.array([east, 0.0, 0.0])
        )
        sea_level = vehicle.sea_level
        assert sea_level is not None
        mav = mavlink.MAVLink(None, 255, 190)
        message = mavlink.MAVLink_command_int_message(
            *vehicle.connection.target,
            *(mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_CMD_DO_SET_HOME, 0, 0, 0, 0, 0, 0),
            *(round(latitude * 1e7), round(longitude * 1e7), sea_level + up),
        )
        flight.relay.inject(message.pack(mav))
        heights: list[float] = []
        flight.run(
            2.5,
            lambda: not flight.mission.handover.flies,
            lambda state: heights.append(state.odometry.height),
        )
        flight.run(4.0, each=lambda state: heights.append(state.odometry.height))
        flight.tell_outcome(f"home moved by {east:g} m east and {up:g} m up")
        assert any("its home has moved" in alert.text for alert in flight.mission.alerts)
        assert any(alert.text.startswith("home: its own") for alert in flight.mission.alerts)
        assert flight.modes[-1] is VehicleMode.GUIDED, flight.story
        assert min(heights) > 7.0
        assert max(heights) < 9.0
        flight.run(240.0)
        assert flight.mission.state is S.LANDED, flight.story
        assert witness.away < 2.0
