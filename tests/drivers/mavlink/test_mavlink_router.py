"""Two vehicles and a ground station behind a router, as one address."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest
from autopilot import MODE
from emulated import LOOPBACK, Flight, Stepped, free_port
from router import Router
from rtcm_station import BaseStation, rtcm

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.messages.vehicle import VehicleMode
from tools.mavlink_vehicle import AutopilotOptions

_LOITER = 5
"""ArduCopter's mode of a pilot who wants to stay where he is."""
_MODES = (VehicleMode.HOLDING, VehicleMode.GUIDED)


class GroundStation:
    """A ground station at the router, with QGroundControl's ids."""

    def __init__(self, router: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((LOOPBACK, router))
        self._socket.settimeout(0.0)
        self._mav = mavlink.MAVLink(None, 255, 190)
        self.close = self._socket.close

    def say(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        """Say it to all."""
        self._socket.send(message.pack(self._mav))

    def beat(self, _: float) -> None:
        """Send a HEARTBEAT."""
        self.say(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 192, 0, 4, 3))

    def senders(self) -> set[tuple[int, int]]:
        """Systems and components that it has heard."""
        ear, heard = mavlink.MAVLink(None, 9, 9), set[tuple[int, int]]()
        while True:
            try:
                message = ear.decode(bytearray(self._socket.recv(4096)))
            except BlockingIOError:
                return heard
            heard.add((message.get_srcSystem(), message.get_srcComponent()))


@contextmanager
def routed(
    flight: Flight,
    *systems: int,
    **first: Any,  # noqa: ANN401
) -> Iterator[tuple[list[Stepped], GroundStation]]:
    """Vehicles 1 and 2 behind a router; drivers for `systems`, with `first` for that of one."""
    with ExitStack() as opened:
        port = free_port()
        router = opened.enter_context(Router(port))
        station = GroundStation(router.port)
        opened.callback(station.close)
        ends: list[Stepped] = []
        for number, system in enumerate(systems, 1):
            options = AutopilotOptions(family="ardupilot", system=number)
            made = flight(
                options,
                beside=ends[0] if ends else None,
                port=port,
                router=router.port,
                system=system,
                **(first if number == 1 else {}),
            )
            made.clock.turns += [] if ends else [station.beat]
            ends.append(opened.enter_context(made))
        yield ends, station


def test_each_vehicle_obeys_its_own_robot_and_the_ground_station(flight: Flight) -> None:
    """Corrections reach each once; a mode that the station asks for is a pilot's, of one alone."""
    message = rtcm(bytes(range(200)))
    with BaseStation() as base, routed(flight, 1, 2, corrections=base.url) as (ends, station):
        left, right = ends

        def both(condition: Any) -> None:  # noqa: ANN401
            """Both are read: a robot whose loop is silent would be sent home."""
            left.wait(lambda: (right.vehicle.read(), condition())[1], 60.0)

        base.say(message)
        both(lambda: all(len(one.heard("GPS_RTCM_DATA")) >= 2 for one in ends))
        right.vehicle.take_off(2.0)
        both(lambda: right.vehicle.read().mode in _MODES)
        assert not left.autopilot.armed
        left.vehicle.take_off(2.0)
        both(lambda: left.vehicle.read().mode in _MODES)
        # Each was sent all that the router carries, and has taken its own.
        for one in ends:
            parts = one.heard("GPS_RTCM_DATA")
            assert b"".join(bytes(part.data[: part.len]) for part in parts) == message
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
