"""A driver and an autopilot whose every word the test writes, on a clock that the test moves."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mavlink_flights import robot_of

from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire import link
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.types.vehicle import VehicleMode

__all__ = ["HOLD", "LAND", "OFFBOARD", "POSITION", "RETURN", "TAKE_OFF", "Handmade"]

OFFBOARD, POSITION = 6 << 16, 3 << 16
TAKE_OFF, HOLD, RETURN, LAND = (4 << 16 | sub << 24 for sub in (2, 3, 5, 6))
"""PX4's custom modes."""

_STEP = 0.05
_PEER = ("127.0.0.1", 14550)


class Handmade:
    """A PX4 at 47 north, 8 east, that speaks 20 times a second and does nothing by itself.

    Each of its attributes is what it says next; it acknowledges what it is told while it `agrees`.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **settings: Any) -> None:  # noqa: ANN401
        self.now = 1000.0
        self.custom_mode = POSITION
        self.armed = False
        self.state = mavlink.MAV_STATE_ACTIVE
        self.position = np.array([10.0, 20.0, -3.0])
        """Metres north, east, down of its own zero."""
        self.velocity = np.zeros(3)
        self.landed = mavlink.MAV_LANDED_STATE_ON_GROUND
        self.well = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        self.speaks = True
        self.result: int | None = mavlink.MAV_RESULT_ACCEPTED
        """Of each order; None: no acknowledgement at all."""
        self.heard: list[tuple[float, Any]] = []
        """What we told it, each with its second."""
        self._mav = mavlink.MAVLink(None, 1, 1)
        self._ear = mavlink.MAVLink(None, 9, 9)
        self._inbox: list[tuple[bytes, tuple[str, int]]] = []
        clock = SimpleNamespace(monotonic=lambda: self.now, sleep=lambda _: self.advance())
        controls = ("control.mode_change", "control.watchdog")
        services = ("microservices.mission_mode", "microservices.payload")
        for module in ("vehicle", "connecting", *controls, *services):
            monkeypatch.setattr(f"aerodaas.drivers.mavlink.{module}.time", clock)
        self._links: list[MavlinkLink] = []

        def begin(started: MavlinkLink) -> None:
            self._links.append(started)

        monkeypatch.setattr(MavlinkLink, "_start", begin)
        monkeypatch.setattr(link, "open_transport", lambda *_: self)
        self.robot = robot_of(1, failsafes="ignore", fallback="ignore", **settings)
        self.vehicle = MavlinkVehicle(self.robot, EnvironmentConfig(robots=[self.robot]))

    def receive(self) -> list[tuple[bytes, tuple[str, int]]]:
        """As the wire."""
        arrived, self._inbox = self._inbox, []
        return arrived

    def send(self, packet: bytes, _: object) -> None:
        """As the wire: hear, and acknowledge."""
        message = self._ear.decode(bytearray(packet))
        self.heard.append((round(self.now, 3), message))
        if message.get_type() in {"COMMAND_LONG", "COMMAND_INT"} and self.result is not None:
            ack = mavlink.MAVLink_command_ack_message(message.command, self.result, 0, 0, 245, 191)
            self.say(ack)

    def close(self) -> None:
        """As the wire."""

    def say(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        """Say something, to be heard at the next turn."""
        self._inbox.append((bytes(message.pack(self._mav)), _PEER))
        self._mav.seq = (self._mav.seq + 1) % 256

    def receive_also(self, packet: bytes, peer: tuple[str, int] | None) -> None:
        """Let a packet come as well, from the vehicle's own address (None) or from elsewhere."""
        self._inbox.append((packet, peer or _PEER))

    def advance(self, seconds: float = _STEP) -> None:
        """Let time pass at both ends."""
        for _ in range(round(seconds / _STEP)):
            self.now = round(self.now + _STEP, 6)
            if self.speaks:
                self._speak()
            for one in self._links[-1:]:
                one.turn(self.now)

    def _speak(self) -> None:
        boot = round((self.now - 900.0) * 1e3)
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        # 488 m above the sea where it stands first.
        altitude = 485_000 - round(float(np.nan_to_num(self.position[2])) * 1e3)
        for message in (
            mavlink.MAVLink_heartbeat_message(2, 12, armed, self.custom_mode, self.state, 3),
            mavlink.MAVLink_sys_status_message(
                self.well | 1, self.well | 1, self.well | 1, 100, 12000, 500, 50, 0, 0, 0, 0, 0, 0
            ),
            mavlink.MAVLink_extended_sys_state_message(0, self.landed),
            mavlink.MAVLink_attitude_message(boot, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_local_position_ned_message(boot, *self.position, *self.velocity),
            mavlink.MAVLink_global_position_int_message(
                boot, 470000000, 80000000, altitude, 0, 0, 0, 0, 0
            ),
        ):
            self.say(message)

    def connect(self) -> None:
        """Meet, and forget what was said until then."""
        self.vehicle.connect(5.0)
        self.advance(1.0)
        self.heard.clear()

    def turn(self, seconds: float = _STEP) -> VehicleMode:
        """Turn the control loop for a while; the mode that it reads at last."""
        mode = self.vehicle.read().mode
        for _ in range(round(seconds / _STEP)):
            self.advance()
            mode = self.vehicle.read().mode
        return mode

    def fly(self, height: float = 5.0, mode: int = HOLD) -> None:
        """Be found in the air, `height` metres above where it was armed, after a take-off."""
        self.vehicle.take_off(height)
        self.custom_mode = HOLD
        self.turn(0.2)
        self.armed = True
        self.turn(0.2)
        self.custom_mode, self.landed = TAKE_OFF, mavlink.MAV_LANDED_STATE_IN_AIR
        self.rise(height)
        self.custom_mode = mode
        self.turn(0.5)
        self.heard.clear()

    def rise(self, metres: float) -> None:
        """Rise at 2 m/s, and stop there."""
        self.velocity = np.array([0.0, 0.0, -2.0])
        for _ in range(round(10 * metres)):
            self.position = self.position - np.array([0.0, 0.0, 0.1])
            self.turn()
        self.velocity = np.zeros(3)
        self.turn()

    def told(self, *kinds: str) -> list[Any]:
        """Messages of these kinds that it was told."""
        return [one for _, one in self.heard if one.get_type() in kinds]

    def modes(self) -> list[int]:
        """Modes that it was asked for, as its HEARTBEATs would show them."""
        return [
            int(one.param2) << 16 | int(one.param3) << 24
            for one in self.told("COMMAND_LONG")
            if one.command == mavlink.MAV_CMD_DO_SET_MODE
        ]

    def orders(self) -> list[int]:
        """Numbers of its orders, without those for messages."""
        return [
            one.command
            for one in self.told("COMMAND_LONG", "COMMAND_INT")
            if one.command
            not in {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE}
        ]
