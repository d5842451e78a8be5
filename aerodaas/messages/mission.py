"""Status, setpoints and scheduling decisions of a running mission."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from aerodaas.geometry.frames import is_finite
from aerodaas.messages.frames import Header
from aerodaas.messages.health import HealthReport
from aerodaas.messages.serialization.json_types import Int64, Real
from aerodaas.messages.serialization.records import UNSENT, fast_pickle
from aerodaas.messages.vehicle import Setpoint, VehicleState
from aerodaas.messages.waypoints import Waypoint

__all__ = [
    "GROUNDED",
    "RECENT",
    "BatteryOutlook",
    "Decision",
    "MissionPlan",
    "MissionState",
    "MissionStatus",
    "Place",
    "RobotStatus",
    "SetpointRecord",
]

Place: TypeAlias = tuple[float, float, float]
"""Metres east, north and up of home."""
RECENT = 64
"""Most ids in a status' lists: a mission of hours reaches thousands of waypoints."""


class MissionState(str, enum.Enum):
    """The 13 states of a mission (the paper's stat-stream)."""

    IDLE = "idle"
    """Nothing has been asked yet."""
    PREFLIGHT = "preflight"
    """Checking whether a take-off is safe."""
    TAKING_OFF = "taking_off"
    HOLDING = "holding"
    """In the air, waiting for navigation."""
    ENROUTE = "enroute"
    """Flying to the next waypoint of the plan."""
    LOITERING = "loitering"
    """Staying at a waypoint for its hover duration."""
    FOLLOWING = "following"
    """Flying by velocity commands from analytics."""
    DIVERTED = "diverted"
    """Serving more urgent navigation; the plan resumes afterwards."""
    PAUSED = "paused"
    RETURNING = "returning"
    LANDING = "landing"
    LANDED = "landed"
    """On the ground after a flight; the mission is over."""
    ABORTED = "aborted"
    """Over without having been completed: refused, taken over or lost, as the reason says."""


GROUNDED = frozenset(
    {MissionState.IDLE, MissionState.PREFLIGHT, MissionState.LANDED, MissionState.ABORTED}
)
"""States of a drone that is not in the air, as far as its mission knows."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class BatteryOutlook:
    """How far the battery lasts, by the energy model as this flight scaled it; charges 0 to 1."""

    plan: Real
    """Charge that it takes from now on to fly the rest of the plan and home, and to have
    `battery_land` left; more than 1 where no battery has it."""
    returns_at: Real
    """Charge at which the drone would return from where it is: `battery_return`, or more where the
    way home needs it."""
    hover: Real
    """Seconds of hovering where it is until then; 0 where it is due."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class MissionStatus:
    """The mission at one moment."""

    stamp: Int64
    """Mission clock, nanoseconds."""
    state: MissionState
    reason: str = ""
    """Why the mission is in this state, one sentence."""
    target: Waypoint | None = None
    """Waypoint being flown to or loitered at, local ENU."""
    pending: tuple[Waypoint, ...] = ()
    """Waypoints still to be visited after the target, in planned order."""
    visited: tuple[str, ...] = ()
    """Ids of the waypoints reached last, in order; `RECENT` at most, for a status is sent often."""
    given_up: tuple[str, ...] = ()
    """Ids of the waypoints refused last by the scheduler or the safety layer; `RECENT` at most."""
    distance: Real = 0.0
    """Metres flown since take-off."""
    faults: tuple[str, ...] = ()
    """Present faults, as the safety layer names them."""
    visits: Int64 = 0
    """How often a waypoint has been reached since take-off; `visited` holds the last of them."""
    waypoint_counts: tuple[Int64, Int64] = (0, 0)
    """How many waypoints were visited, and how many are known; one visited twice is one."""
    pilot: str = ""
    """Who flies the drone by hand now; empty for nobody."""
    outlook: BatteryOutlook | None = None
    """Forecast before take-off, on the way through the plan, and while paused; None 2 s after that,
    and where charge or place is not known."""
    photos: tuple[Int64, Int64] = (0, 0)
    """How many pictures were taken, and how many that waypoints asked for were not."""
    unfinished: str = ""
    """What ended the mission before its plan was flown; empty if nothing did, or a command."""

    @property
    def ahead(self) -> tuple[Waypoint, ...]:
        """The target and the waypoints after it."""
        return self.pending if self.target is None else (self.target, *self.pending)

    @property
    def progress(self) -> float:
        """Share of the known waypoints that have been visited, 0 to 1."""
        visited, known = self.waypoint_counts
        return visited / known if known else 0.0


@fast_pickle
@dataclass(frozen=True, slots=True)
class MissionPlan:
    """The waypoints ahead of a robot, local ENU."""

    stamp: Int64
    """Mission clock, nanoseconds."""
    waypoints: tuple[Waypoint, ...]
    """The present target first."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class RobotStatus:
    """Status of one robot at one time: of its mission and of its vehicle."""

    mission: MissionStatus
    vehicle: VehicleState | None = None
    """None before the vehicle's first state."""
    health: HealthReport = field(default=HealthReport(), metadata=UNSENT)
    """The list before take-off."""
    latencies: tuple[float, ...] = field(default=(), metadata=UNSENT)
    """Milliseconds from capture to command, newest last."""

    @property
    def charge(self) -> float | None:
        """Charge left, 0 to 1; None where it is not known."""
        charge = math.nan if self.vehicle is None else self.vehicle.battery.fraction
        return charge if math.isfinite(charge) else None

    @property
    def place(self) -> Place | None:
        """Metres east, north and up of home; None where it is not known."""
        if self.vehicle is None or not is_finite(self.vehicle.odometry.position):
            return None
        east, north, up = map(float, self.vehicle.odometry.position)
        return east, north, up

    @property
    def public(self) -> RobotStatus:
        """The status without the simulator's truth and the driver's further figures."""
        vehicle = self.vehicle
        return self if vehicle is None else replace(self, vehicle=vehicle.public)


@fast_pickle
@dataclass(frozen=True, slots=True)
class SetpointRecord:
    """One turn of the setpoint loop: the requested and the sent setpoint."""

    stamp: Int64
    asked: Setpoint | None
    sent: Setpoint | None
    clipped_by: tuple[str, ...] = ()
    """Names of the limits that changed it, such as `max_speed` or `geofence`."""
    cause: Header | None = None
    """Measurement that the command behind this setpoint was made from, for latency."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class Decision:
    """One decision of an analytics scheduler, with its reason."""

    stamp: Int64
    task: str
    """Analysis and frame, `node#frame`; `node#camera:frame` where it watches several cameras."""
    action: str
    """`edge`, `cloud`, `drop` are decisions, `retry` is one of the dispatcher's; `done`, `late`,
    `timeout`, `failed` and `dropped` (it never came to its turn) are how a task ended."""
    reason: str = ""
    values: dict[str, Real] = field(default_factory=dict)
    """Figures behind it: milliseconds, or utility in the environment file's own unit."""
