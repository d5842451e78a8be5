"""Two vehicles and a ground station behind a router, as one address."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest
from mavlink_flights import LOOPBACK, Pair, free_port, robot_of, wait_for
from router import Router
from rtcm_station import BaseStation, rtcm

from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.errors import VehicleError
from aerodaas.types.vehicle import VehicleMode
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

_LOITER = 5
"""ArduCopter's mode of a pilot who wants to stay where he is."""
_MODES = (VehicleMode.HOLDING, VehicleMode.GUIDED)
STATION = (255, 190)
"""QGroundControl's ids."""


class GroundStation:
    """A ground station at the router."""

    def __init__(self, router: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((LOOPBACK, router))
        self._socket.settimeout(0.0)
        self._mav = mavlink.MAVLink(None, *STATION)
        self._ear = mavlink.MAVLink(None, 9, 9)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._beat, daemon=True)
        self._thread.start()
        self.senders: set[tuple[int, int]] = set()
        """Systems and components that it has heard."""

    def say(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        """Say it to all."""
        self._socket.send(message.pack(self._mav))

    def _beat(self) -> None:
        beat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 192, 0, 4, 3)
        codec = mavlink.MAVLink(None, *STATION)
        while not self._closing.wait(0.5):
            self._socket.send(beat.pack(codec))

    def listen(self) -> None:
        """Take note of who speaks."""
        while True:
            try:
                content = self._socket.recv(4096)
            except BlockingIOError:
                return
            message = self._ear.decode(bytearray(content))
            self.senders.add((message.get_srcSystem(), message.get_srcComponent()))

    def close(self) -> None:
        """Leave."""
        self._closing.set()
        self._thread.join()
        self._socket.close()


@contextmanager
def routed(*systems: int, **first: Any) -> Iterator[tuple[list[Pair], GroundStation]]:  # noqa: ANN401
    """Emulated vehicles 1 and 2 behind a router; drivers for `systems`, `first` for vehicle 1's."""
    port = free_port()
    robots = [
        robot_of(
            port,
            system=system,
            failsafes="ignore",
            fallback="ignore",
            **(first if system == 1 else {}),
        ).model_copy(update={"id": f"drone{system}"})
        for system in systems
    ]
    environment = EnvironmentConfig(robots=robots)
    with ExitStack() as opened:
        router = opened.enter_context(Router(port))
        station = GroundStation(router.port)
        opened.callback(station.close)
        autopilots = {
            number: opened.enter_context(
                EmulatedAutopilot(
                    AutopilotOptions(
                        family="ardupilot", system=number, peer=(LOOPBACK, router.port)
                    )
                )
            )
            for number in (1, 2)
        }
        pairs = []
        for system, robot in zip(systems, robots, strict=True):
            vehicle = MavlinkVehicle(robot, environment)
            opened.callback(vehicle.close)
            vehicle.connect(3.0)
            pairs.append(Pair(autopilots[system], vehicle, robot))
        yield pairs, station


def _modes(pairs: list[Pair]) -> list[VehicleMode]:
    return [pair.vehicle.read().mode for pair in pairs]


def test_each_vehicle_obeys_its_own_robot_and_the_ground_station() -> None:
    """Corrections reach each once; a mode that the station asks for is a pilot's, of one alone."""
    message = rtcm(bytes(range(200)))
    with BaseStation() as base, routed(1, 2, corrections=base.url) as (pairs, station):
        left, right = pairs
        base.say(message)
        wait_for(lambda: all(len(pair.heard("GPS_RTCM_DATA")) >= 2 for pair in pairs))
        right.vehicle.take_off(2.0)
        wait_for(lambda: _modes(pairs)[1] in _MODES)
        assert not left.autopilot.armed
        left.vehicle.take_off(2.0)
        wait_for(lambda: _modes(pairs)[0] in _MODES)
        # Each was sent all that the router carries, and has taken its own.
        for pair in pairs:
            parts = pair.heard("GPS_RTCM_DATA")
            assert b"".join(bytes(one.data[: one.len]) for one in parts) == message
        command = mavlink.MAVLink_command_long_message(
            *(2, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, _LOITER, 0, 0, 0, 0, 0)
        )
        station.say(command)
        # Both are read: a robot whose loop is silent would be sent home.
        wait_for(lambda: _modes(pairs)[1] is VehicleMode.MANUAL)
        assert _modes(pairs)[0] in _MODES
        with pytest.raises(VehicleError, match="a pilot flies it"):
            right.vehicle.land()
        station.listen()
        assert station.senders == {(1, 1), (2, 1), (245, 191)}


def test_a_ground_station_is_no_vehicle() -> None:
    """Its id is not taken for one that was asked for."""
    with pytest.raises(VehicleError, match="system 255: a gcs"), routed(255):
        pass
