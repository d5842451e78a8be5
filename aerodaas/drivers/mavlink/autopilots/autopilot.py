"""Interface of an autopilot family: everything in which PX4 and ArduPilot differ."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

from aerodaas.drivers.mavlink.microservices.commander import PendingCommand
from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["ANYWHERE", "NOT_GIVEN", "Autopilot", "Failsafe", "FenceAction"]

FenceAction = Literal["warn", "hold", "return", "land"]
NOT_GIVEN = float("nan")
ANYWHERE = 0x7FFFFFFF
"""Latitude or longitude of a COMMAND_INT for the vehicle's present position."""


@dataclass(frozen=True)
class Failsafe:
    """A parameter that decides whether the vehicle protects itself."""

    name: str
    unsafe: frozenset[float]
    """Values that leave it unprotected."""
    safe: float
    """The value to be set."""
    why: str
    role: Literal["any", "ground_station"] = "any"
    """True if it matters in the role of the ground station only."""


class Autopilot(ABC):
    """One family of autopilots. It holds no state: the vehicle's is in the `Telemetry`."""

    name: ClassVar[str]
    family: ClassVar[int]
    """MAV_AUTOPILOT of its HEARTBEAT."""
    stream_before: ClassVar[float]
    """Seconds of setpoints before guided flight may be commanded."""
    stops_short: ClassVar[bool]
    """Whether it holds before it has reached the height of a take-off."""
    failsafes: ClassVar[tuple[Failsafe, ...]]
    alone: ClassVar[str]
    """Its behaviour once our process is gone."""
    orphaned: ClassVar[str] = ""
    """Its behaviour if a companion's process dies, where no parameter makes that safe."""
    rates: ClassVar[dict[int, float]] = {
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 20.0,
        mavlink.MAVLINK_MSG_ID_ATTITUDE: 20.0,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 4.0,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 2.0,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 4.0,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION: 1.0,
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 1.0,
        mavlink.MAVLINK_MSG_ID_VIBRATION: 1.0,
    }
    """Required messages, and their rates in Hz."""

    @abstractmethod
    def mode(self, custom_mode: int) -> FlightMode:
        """The flight mode of a HEARTBEAT."""

    @abstractmethod
    def mode_name(self, custom_mode: int) -> str:
        """The mode's usual name."""

    @abstractmethod
    def ask_mode(self, mode: FlightMode) -> PendingCommand:
        """Command one of its modes."""

    @abstractmethod
    def take_off(self, height: float, telemetry: Telemetry) -> tuple[PendingCommand, ...]:
        """Orders for arming and a climb of `height` metres, each after the previous one's end."""

    @abstractmethod
    def ready(self, telemetry: Telemetry) -> bool | None:
        """Whether its arming checks pass; None if it does not report them."""

    @abstractmethod
    def objections(self, telemetry: Telemetry, now: float) -> list[str]:
        """Reasons why it would not arm, in its own texts as far as it sends any."""

    @abstractmethod
    def encode(self, value: float, kind: int) -> float:
        """A parameter's value as PARAM_SET carries it."""

    @abstractmethod
    def decode(self, value: float, kind: int) -> float:
        """A parameter's value from PARAM_VALUE."""

    @abstractmethod
    def fence(self, action: FenceAction, ceiling: float) -> dict[str, float]:
        """Parameters without which an uploaded fence is not enforced; `ceiling` metres."""

    @staticmethod
    def arm() -> PendingCommand:
        """Start the motors; the autopilot's checks apply."""
        values = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return PendingCommand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, values, "arm")

    @staticmethod
    def disarm() -> PendingCommand:
        """Stop the motors, which it refuses in the air."""
        values = (0.0,) * 7
        return PendingCommand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, values, "disarm", insists=False)

    @staticmethod
    def check() -> PendingCommand:
        """Request a report of its arming checks."""
        values = (0.0,) * 7
        return PendingCommand(mavlink.MAV_CMD_RUN_PREARM_CHECKS, values, "run the arming checks")

    @staticmethod
    def interval(message: int, rate: float) -> PendingCommand:
        """Request a message `rate` times a second."""
        values = (float(message), 1e6 / rate, 0.0, 0.0, 0.0, 0.0, 0.0)
        what = f"send message {message} at {rate:g} Hz"
        return PendingCommand(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, values, what)

    @staticmethod
    def version() -> PendingCommand:
        """Request AUTOPILOT_VERSION."""
        values = (float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return PendingCommand(mavlink.MAV_CMD_REQUEST_MESSAGE, values, "tell the version")
