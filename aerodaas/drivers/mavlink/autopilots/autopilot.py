"""Interface of an autopilot family: everything in which PX4 and ArduPilot differ."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

from aerodaas.drivers.mavlink.microservices.commander import PendingCommand
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = [
    "ANYWHERE",
    "NOT_GIVEN",
    "Autopilot",
    "Failsafe",
    "FallbackParameter",
    "FenceAction",
    "older_than",
    "return_height",
]

FenceAction = Literal["warn", "hold", "return", "land"]
NOT_GIVEN = float("nan")
_LOWEST_RETURN = 2.0
"""Metres of a return: ArduPilot's RTL_ALT_MIN."""
_BELOW_CEILING = 2.0
"""Metres below the geofence's ceiling at which we set a return's height."""
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


@dataclass(frozen=True)
class FallbackParameter:
    """A parameter on which it depends whether the vehicle comes home once we are silent."""

    names: tuple[str, ...]
    """Its names in different versions of the firmware; the vehicle knows one of them."""
    fits: Callable[[float], bool]
    value: float
    """The value to be set where its own does not fit."""
    why: str
    """What follows from a value that does not fit."""
    scales: tuple[float, ...] = (1.0, 1.0)
    """For each name, how many of its units `fits` and `value` count as one."""
    bits: bool = False
    """Whether `value` is bits that are added to what is set."""
    beside: str = ""
    """Some versions have it beside this one, and others do not: then nothing depends on it."""


def return_height(
    ceiling: float, *names: str, scales: tuple[float, ...] = (1.0, 1.0)
) -> FallbackParameter:
    """The height of its return, which must stay below the geofence's ceiling.

    Args:
        ceiling: Metres above home.
        scales: Scale of the parameter by name, as `FallbackParameter` has it.
        *names: Names of the parameter in the versions of the autopilot.
    """
    return FallbackParameter(
        names,
        lambda metres: metres <= ceiling,
        max(_LOWEST_RETURN, ceiling - _BELOW_CEILING),
        f"it would return above the geofence's ceiling of {ceiling:g} m",
        scales=scales,
    )


def older_than(software: str, *version: int) -> bool:
    """Whether a version such as `1.13.3` is known to be older than `version`.

    Args:
        software: The version's text; one without numbers is not known.
        *version: Numbers to compare with, the major one first.
    """
    numbers = tuple(int(number) for number in re.findall(r"\d+", software))
    return bool(numbers) and numbers[: len(version)] < version


class Autopilot(ABC):
    """One family of autopilots. It holds no state: the vehicle's is in the `Telemetry`."""

    name: ClassVar[str]
    family: ClassVar[int]
    """MAV_AUTOPILOT of its HEARTBEAT."""
    stream_before: ClassVar[float]
    """Seconds of setpoints before guided flight may be commanded."""
    stops_short: ClassVar[float]
    """Metres below the height of a take-off from which on it may end that and hold; 0: it never
    holds."""
    failsafes: ClassVar[tuple[Failsafe, ...]]
    alone: ClassVar[str]
    """Its behaviour once our process is gone, with the parameters that it is delivered with."""
    comes_home: ClassVar[str]
    """The same with a fallback."""
    ways_home: ClassVar[frozenset[str]]
    """Those of `return` and `retrace` that its own protection can fly."""
    home_comes_first: ClassVar[bool]
    """Whether the first item of a mission is its home, whatever is sent."""
    turns_at_waypoints: ClassVar[bool]
    """Whether a waypoint of its mission has a yaw."""
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
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
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
        """Orders for arming and a climb, each after the previous one's end.

        Args:
            height: Height to climb, metres.
            telemetry: What the vehicle has told so far.
        """

    @abstractmethod
    def ready(self, telemetry: Telemetry) -> bool | None:
        """Whether its arming checks pass; None if it does not report them."""

    @abstractmethod
    def objections(self, telemetry: Telemetry, now: float) -> list[str]:
        """Reasons why it would not arm, in its own texts as far as it sends any.

        Args:
            telemetry: What the vehicle has told so far.
            now: Monotonic clock, seconds.
        """

    @abstractmethod
    def protection_reasons(self, telemetry: Telemetry, now: float, seconds: float) -> list[str]:
        """Reasons for which the autopilot's own protection acts.

        Args:
            telemetry: The vehicle's.
            now: Monotonic seconds.
            seconds: Greatest age of what it says.

        Returns:
            Its own words or ours for them, the most telling first; empty if it tells none.
        """

    @abstractmethod
    def encode(self, value: float, kind: int) -> float:
        """A parameter's value as PARAM_SET carries it.

        Args:
            value: The parameter's value.
            kind: Its MAV_PARAM_TYPE.
        """

    @abstractmethod
    def decode(self, value: float, kind: int) -> float:
        """A parameter's value from PARAM_VALUE.

        Args:
            value: As PARAM_VALUE carries it.
            kind: Its MAV_PARAM_TYPE.
        """

    @abstractmethod
    def fallback(
        self, settings: MavlinkSettings, ceiling: float, software: str
    ) -> tuple[FallbackParameter, ...]:
        """Parameters with which it comes home once we are silent, in the order of setting them.

        Args:
            settings: Our system id, and when and how it is to come home.
            ceiling: Ceiling of the geofence, metres above home.
            software: Version of the autopilot; empty where it is not known.
        """

    @abstractmethod
    def fence(self, action: FenceAction, ceiling: float) -> dict[str, float]:
        """Parameters without which an uploaded fence is not enforced, by name.

        Args:
            action: What the vehicle does at the fence.
            ceiling: Metres above home.
        """

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
        """Request a message at a rate.

        Args:
            message: Id of the message.
            rate: Messages per second.
        """
        values = (float(message), 1e6 / rate, 0.0, 0.0, 0.0, 0.0, 0.0)
        what = f"send message {message} at {rate:g} Hz"
        return PendingCommand(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, values, what)

    @staticmethod
    def version() -> PendingCommand:
        """Request AUTOPILOT_VERSION."""
        values = (float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return PendingCommand(mavlink.MAV_CMD_REQUEST_MESSAGE, values, "tell the version")
