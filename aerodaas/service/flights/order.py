"""Order of a flight, and its outcome: what the service and the flight's process write down."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from aerodaas.clock import WallOffset
from aerodaas.config.checked import checked
from aerodaas.config.json_text import read_json
from aerodaas.protocol.schemas import Area, Positive, SilencePolicy, StatusOut, VerdictOut

__all__ = [
    "Attached",
    "EdgeTurnsOrder",
    "FlightOrder",
    "OtherLease",
    "Outcome",
    "Progress",
    "TenantLimits",
]


@dataclass(frozen=True)
class TenantLimits:
    """Limits of a tenant, on top of the provider's; None for no further limit."""

    max_height: Positive | None = None
    """Metres above home."""
    max_speed: Positive | None = None
    """m/s, level and upright."""
    max_range: Positive | None = None
    """Metres from the place of take-off."""


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class OtherLease(_Record):
    """Area of another granted lease, from which the rehearsed flight has to stay away."""

    id: str
    area: Area


class Attached(_Record):
    """The flight by whose cameras a mission senses."""

    mission: str
    socket: Path
    """At which its process serves the API."""
    sensors: list[str]
    """Cameras that are shared, by full id."""


class EdgeTurnsOrder(_Record):
    """The tenant's share of the edge."""

    turns: Path
    """Socket of the service that gives turns."""
    tenant: str
    weight: float


class FlightOrder(_Record):
    """All that a flight's process needs to know; the document lies beside it."""

    mission: str
    """Id of the mission."""
    lease: str
    fleet: Path
    """The provider's environment file."""
    robots: list[str]
    locks: Path
    """Folder of the drones' locks, see `RobotLocks`."""
    ends: float
    """End of the lease, Unix seconds; after it the drones come home, whatever becomes of the
    service."""
    offset: WallOffset | None = None
    """Of the wall clock by which `ends` is meant; None for the present one."""
    minutes: float
    """Length of the lease."""
    limits: TenantLimits = TenantLimits()
    area: Area | None = None
    actuators: list[str] = Field(default_factory=list)
    """Actuators that the tenant may move, as `robot/actuator`."""
    silence: SilencePolicy = SilencePolicy.CONTINUE
    silence_seconds: float = 30.0
    speed: Literal["max"] | float = 1.0
    """Mission seconds a wall second; `max`: as fast as the machine goes, in simulated time,
    where all robots are simulated."""
    seed: int | None = None
    address: str | None = None
    """Ray cluster to join; None for one of its own."""
    edge: EdgeTurnsOrder | None = None
    """None where flights use the edge as they like."""
    attached: Attached | None = None
    """For a mission that senses only, which has no robots."""
    rehearsal: bool = False
    """Fly in simulation, and judge the recording."""
    rehearsal_seconds: float = 300.0
    """Most seconds of a processor that the rehearsal uses."""
    rehearsal_bytes: int = 2 << 30
    """Most memory of the same."""
    battery: dict[str, float] = Field(default_factory=dict)
    """Charge by robot, 0 to 1, with which the rehearsal begins."""
    others: list[OtherLease] = Field(default_factory=list)

    @classmethod
    def read(cls, path: Path) -> FlightOrder:
        """Read an order; raises ConfigError for one that is malformed."""
        return checked(cls, read_json(path, "the flight's order"), str(path))


class Progress(_Record):
    """How far a rehearsal has come."""

    flown: float = 0.0
    """Mission seconds."""
    processor: float = 0.0
    """Seconds of a processor that it has used."""


class Outcome(_Record):
    """How a flight ended; written last."""

    landed: bool
    """Whether it ended as planned."""
    reason: str = ""
    began: float
    ended: float
    """Unix seconds."""
    status: dict[str, StatusOut] = Field(default_factory=dict)
    """Last status by robot."""
    alerts: list[str] = Field(default_factory=list)
    flight_seconds: float = 0.0
    """Sum of its robots' time in flight, mission seconds."""
    distance: float = 0.0
    battery_used: float = 0.0
    compute_seconds: dict[str, float] = Field(default_factory=dict)
    cloud_calls: int = 0
    verdict: VerdictOut | None = None
    """Of a rehearsal."""
