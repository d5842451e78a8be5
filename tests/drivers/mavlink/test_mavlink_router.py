"""Two vehicles and a ground station behind a router, as one address."""

from __future__ import annotations

from typing import Any

import pytest
from autopilot import MODE
from emulated import Flight
from routed import routed

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.messages.vehicle import VehicleMode

_LOITER = 5
"""ArduCopter's mode of a pilot who wants to stay where he is."""
_MODES = (VehicleMode.HOLDING, VehicleMode.GUIDED)


def test_each_vehicle_obeys_its_own_robot_and_the_ground_station(flight: Flight) -> None:
    """A mode that the station asks for is a pilot's, of one alone."""
    with routed(flight, 1, 2) as (ends, station):
        left, right = ends

        def both(condition: Any) -> None:  # noqa: ANN401
            """Both are read: a robot whose loop is silent would be sent home."""
            left.wait(lambda: (right.vehicle.read(), condition())[1], 60.0)

        right.vehicle.take_off(2.0)
        both(lambda: right.vehicle.read().mode in _MODES)
        assert not left.autopilot.armed
        left.vehicle.take_off(2.0)
        both(lambda: left.vehicle.read().mode in _MODES)
        station.say(mavlink.MAVLink_command_long_message(2, 1, MODE, 0, 1, _LOITER, 0, 0, 0, 0, 0))
        both(lambda: right.vehicle.read().mode is VehicleMode.MANUAL)
        assert left.vehicle.read().mode in _MODES
        with pytest.raises(VehicleError, match="a pilot flies it"):
            right.vehicle.land()
        assert station.senders() == {(1, 1), (2, 1), (245, 191)}


def test_a_ground_station_is_no_vehicle(flight: Flight) -> None:
    """Its id is not taken for one that was asked for."""
    with pytest.raises(VehicleError, match="system 255: a gcs"), routed(flight, 255):
        pass
