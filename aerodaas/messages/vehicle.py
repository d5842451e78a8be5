"""The protocol of all vehicles: state in, setpoints out.

A driver (`aerodaas.drivers`) implements `Vehicle` for one kind of drone and converts frames and
units once. Nothing above a driver knows which kind it flies.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeAlias, TypeVar, runtime_checkable

from aerodaas.clock import Clock
from aerodaas.geometry.frames import Vector
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.payload import GimbalAttitude
from aerodaas.messages.serialization.json_types import Int64, Real
from aerodaas.messages.serialization.records import UNSENT, fast_pickle

__all__ = [
    "COLLISION",
    "Capabilities",
    "ClockedVehicle",
    "FlightEnd",
    "PlayedVehicle",
    "PositionSetpoint",
    "SeaLevelVehicle",
    "Setpoint",
    "SteppedVehicle",
    "Traffic",
    "Vehicle",
    "VehicleMode",
    "VehicleState",
    "VelocitySetpoint",
    "equipment_of",
]


T = TypeVar("T")


class VehicleMode(str, enum.Enum):
    """The vehicle's flight mode, as it reports it."""

    GROUNDED = "grounded"
    TAKING_OFF = "taking_off"
    GUIDED = "guided"
    """Following our setpoints."""
    HOLDING = "holding"
    MISSION = "mission"
    """Flying the plan that we have handed over, by its own mission mode."""
    RETURNING = "returning"
    LANDING = "landing"
    MANUAL = "manual"
    """A pilot has taken over; we must not send."""
    FAILSAFE = "failsafe"
    """The vehicle's own protection has taken over; we must not send."""
    LOST = "lost"
    """No message from the vehicle within its link time-out."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class Traffic:
    """One aircraft, where it is at the stamp of the state that it stands in."""

    address: Int64
    """24-bit ICAO address."""
    callsign: str
    """Its callsign; its address in hexadecimal digits where it tells none."""
    position: Vector
    """ENU metres; `up` is NaN where its height is not known."""
    velocity: Vector
    """ENU m/s; zero where it is not known."""
    age: Real = 0.0
    """Seconds since it was last heard; its way since then is as its velocity says."""

    @property
    def knows_height(self) -> bool:
        """Whether its height is known."""
        return math.isfinite(self.position[2])


COLLISION = "collision"
"""First word of a vehicle's fault about a collision; it goes on with what, where and how fast."""


class FlightEnd(str, enum.Enum):
    """How a flight ended, as reported by a driver that can tell."""

    LANDED = "landed"
    """It came down gently and stands, on command or of its own accord, at any height."""
    FELL = "fell"
    """Its motors stopped in the air, or it hit the ground."""
    UNHEARD = "unheard"
    """It came down while its link was silent, and stands."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class PositionSetpoint:
    """Fly to a place: ENU metres, yaw in radians (None keeps the present yaw), speed in m/s."""

    position: Vector
    yaw: float | None = None
    speed: float | None = None
    passing_speed: float = 0.0
    """m/s at which the place may be flown through, as another setpoint follows in time; 0 stops
    there. A driver that knows only stops may ignore it."""
    line_from: Vector | None = None
    """Where the straight line to the place begins, ENU metres, on which the vehicle is to be; None:
    where it is now. A driver may ignore it, too."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class VelocitySetpoint:
    """Fly at a velocity: ENU m/s, yaw rate in rad/s counter-clockwise."""

    velocity: Vector
    yaw_rate: float = 0.0
    evasive: bool = False
    """Whether it takes effect at once, within what the vehicle's own controller can do."""


Setpoint: TypeAlias = PositionSetpoint | VelocitySetpoint


@dataclass(frozen=True, slots=True)
class Capabilities:
    """Capabilities of a driver; available before connecting."""

    driver: str
    position_setpoints: bool = True
    velocity_setpoints: bool = True
    global_position: bool = True
    returns_home: bool = True
    """Has a return mode of its own."""
    max_speed: float = 10.0
    """m/s that the vehicle itself can do horizontally."""
    max_climb: float = 3.0
    """m/s that the vehicle itself can do vertically."""
    alone: str = "its own failsafe is what remains"
    """The vehicle's behaviour once the driver's process is gone, for the operator."""
    obeys: bool = True
    """False for a recorded vehicle, which obeys no command."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class VehicleState:
    """The newest knowledge about a vehicle."""

    stamp: Int64
    """Mission clock of the odometry, in nanoseconds."""
    odometry: Odometry
    battery: Battery
    mode: VehicleMode
    armed: bool
    gps: GpsFix | None = None
    truth: Odometry | None = None
    """The simulator's exact state; None for a real vehicle. Only simulated sensors may use it."""
    faults: tuple[str, ...] = ()
    """Present complaints of the vehicle, one sentence each."""
    extra: dict[str, Real] = field(default_factory=dict)
    """Further figures by name in SI units, such as temperature or link quality."""
    ended: FlightEnd | None = None
    """How the latest flight ended; None before and during one, or if the driver cannot tell."""
    gimbal: GimbalAttitude | None = None
    """Where its gimbal looks; None without one, and where it does not say."""
    zoom: float | None = None
    """Percent of its camera's zoom; None without one, and where it does not say."""
    traffic: tuple[Traffic, ...] = ()
    """Other aircraft that it hears of, the nearest first."""
    below: float | None = None
    """Metres straight down to whatever is there, as a rangefinder measures it where the robot's
    limits need one; None without a fresh reading in its range."""
    actuators: dict[str, str] = field(default_factory=dict)
    """Positions last taken by actuator, as far as the vehicle has acknowledged them."""
    video: str = field(default="", repr=False, metadata=UNSENT)
    """Address of its camera's video, as it says; it may hold a password, so it is recorded nowhere
    and sent to nobody else. Empty where it tells none that may be read."""

    @property
    def public(self) -> VehicleState:
        """The state without the simulator's truth, the driver's further figures and addresses."""
        return replace(self, truth=None, extra={}, video="")


@runtime_checkable
class Vehicle(Protocol):
    """One drone. Every method returns at once unless stated otherwise."""

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of this driver."""
        ...

    def connect(self, timeout: float = 10.0) -> None:
        """Connect within `timeout` seconds; raises VehicleError with the reason of a failure."""
        ...

    def read(self) -> VehicleState:
        """Return the newest state; raise VehicleError if not connected."""
        ...

    def preflight(self) -> list[str]:
        """Reasons for which a take-off would be refused now; empty when ready."""
        ...

    def take_off(self, height: float) -> None:
        """Arm and climb to `height` metres above the ground; progress shows in `read`."""
        ...

    def send(self, setpoint: Setpoint) -> Setpoint:
        """Send one setpoint and return it as it was sent, after clipping."""
        ...

    def hold(self) -> None:
        """Stop and stay."""
        ...

    def return_home(self) -> None:
        """Return to the place of take-off and land there."""
        ...

    def land(self) -> None:
        """Land here; the vehicle disarms on the ground."""
        ...

    def close(self) -> None:
        """Let go of the vehicle; it must stay safe on its own."""
        ...


@runtime_checkable
class SteppedVehicle(Vehicle, Protocol):
    """A vehicle whose time is ours: a simulation."""

    def advance_to(self, stamp: int) -> None:
        """Simulate up to mission time `stamp`, in nanoseconds."""
        ...


@runtime_checkable
class ClockedVehicle(Vehicle, Protocol):
    """A vehicle whose time is its own, and whose states are stamped by the mission's clock."""

    def use_clock(self, clock: Clock) -> None:
        """Stamp states by `clock` from now on; called when the mission starts."""
        ...


@runtime_checkable
class SeaLevelVehicle(Vehicle, Protocol):
    """A vehicle that knows its height above mean sea level, by its own model of the geoid."""

    @property
    def sea_level(self) -> float | None:
        """Metres above mean sea level of our frame's zero; None if it is not known (yet)."""
        ...


@runtime_checkable
class PlayedVehicle(SteppedVehicle, Protocol):
    """A recorded vehicle, which comes to an end."""

    @property
    def finished(self) -> bool:
        """True at the end of the recording."""
        ...


def equipment_of(vehicle: object, kind: type[T]) -> T | None:
    """The vehicle's equipment of one kind, such as its payload or its actuators.

    A driver lists what a vehicle carries in its attribute `equipment`; extensions use it. Ask once:
    to ask a protocol about an object looks up all its members each time.

    Args:
        vehicle: A vehicle, with or without equipment.
        kind: A class, or a protocol that is checked at run time.
    """
    return next((one for one in getattr(vehicle, "equipment", ()) if isinstance(one, kind)), None)
