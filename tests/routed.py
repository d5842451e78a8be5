"""Vehicles and a ground station behind a router, as one address."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from emulated import LOOPBACK, Flight, Stepped, free_port
from router import Router

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from tools.mavlink_vehicle import AutopilotOptions

__all__ = ["GroundStation", "routed"]


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
