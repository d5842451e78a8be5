"""JSON messages of the remote control; units are metres, seconds and radians."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Annotated

from pydantic import BaseModel, ConfigDict, FailFast, Field, field_validator

from aerodaas.clock import seconds
from aerodaas.dataflow.mission_document import WaypointEntry
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionStatus
from aerodaas.messages.vehicle import Traffic, VehicleState
from aerodaas.messages.waypoints import NavigationType, SchedulingType, Waypoint
from aerodaas.mission.commands import Answer

__all__ = ["AnswerOut", "OutlookOut", "StatusOut", "WaypointsIn"]

_MOST_WAYPOINTS = 1000
_MOST_INDEX = 10_000


class _Strict(BaseModel):
    """Base of request models: numbers must be JSON numbers, and unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class WaypointsIn(_Strict):
    """Waypoints to add to the mission."""

    waypoints: Annotated[
        list[WaypointEntry], Field(min_length=1, max_length=_MOST_WAYPOINTS), FailFast()
    ]
    ordered: bool = True
    """Whether to keep their order; otherwise the scheduler chooses it."""
    index: Annotated[int, Field(ge=0, le=_MOST_INDEX)] | None = None
    """Number of waypoints of the same priority to visit before these."""

    @field_validator("waypoints")
    @classmethod
    def _distinct(cls, waypoints: list[WaypointEntry]) -> list[WaypointEntry]:
        counts = Counter(waypoint.id for waypoint in waypoints)
        twice = sorted(name for name, count in counts.items() if count > 1)
        if twice:
            message = f"more than one waypoint is called {', '.join(twice)}"
            raise ValueError(message)
        return waypoints

    def navigation(self) -> AeroNavigation:
        """Convert to navigation; raises InvalidWaypointError for waypoints that cannot be flown."""
        return AeroNavigation(
            NavigationType.ANALYTICS_DRIVEN,
            [waypoint.waypoint() for waypoint in self.waypoints],
            SchedulingType.ORDERED if self.ordered else SchedulingType.UNORDERED,
        )


class AnswerOut(BaseModel):
    """Answer of the mission, or of the service on its behalf, to a command."""

    accepted: bool
    text: str = ""
    refused: Mapping[str, str] = Field(default_factory=dict)
    """Reason by waypoint id, for the refused waypoints."""

    @classmethod
    def of(cls, answer: Answer) -> AnswerOut:
        """Convert the mission's answer."""
        return cls(accepted=answer.accepted, text=answer.text, refused=dict(answer.refused))


class OutlookOut(BaseModel):
    """How far the battery lasts from here, by the energy model as the flight has shown it."""

    plan: float
    """Charge that the rest of the plan, the way home and the reserve of a landing need now; more
    than 1 where no battery has it."""
    returns_at: float
    """Charge at which the drone would return from where it is, 0 to 1."""
    hover: float
    """Seconds until then, if it stays where it is."""


class TrafficOut(BaseModel):
    """Another aircraft that the vehicle hears of, where it is at the moment of its state."""

    address: int
    """24-bit ICAO address."""
    callsign: str
    position: tuple[float, float, float | None]
    """Metres east, north and up of home; `up` is null where its height is not known."""
    velocity: tuple[float, float, float]
    """m/s east, north and up; zeros where it is not known."""
    age: float
    """Seconds since it was last heard."""

    @classmethod
    def of(cls, aircraft: Traffic) -> TrafficOut:
        """Convert one of a vehicle's state."""
        east, north, up = map(float, aircraft.position)
        eastward, northward, upward = map(float, aircraft.velocity)
        return cls(
            address=aircraft.address,
            callsign=aircraft.callsign,
            position=(east, north, _known(up)),
            velocity=(eastward, northward, upward),
            age=aircraft.age,
        )


class StatusOut(BaseModel):
    """Status of mission and vehicle at one time; unknown values are null."""

    time: float
    """Mission time, seconds."""
    state: str
    """One of the 13 states of `MissionState`."""
    reason: str
    target: str | None
    """Waypoint being flown to or hovered at."""
    pending: list[str]
    visited: list[str]
    """Waypoints reached last, in order; at most 64."""
    given_up: list[str]
    """Waypoints refused last; at most 64."""
    waypoints_visited: int
    waypoints_known: int
    """Waypoints visited or ahead; one visited twice counts once."""
    distance: float
    """Metres flown."""
    faults: list[str]
    pilot: str = ""
    """Who flies it by hand now; empty for nobody."""
    places: dict[str, tuple[float, float, float]] = Field(default_factory=dict)
    """Waypoints by id, metres east, north and up of home: those ahead, and those known before."""
    mode: str | None = None
    """One of `VehicleMode`: what the vehicle itself says that it does."""
    measured: float | None = None
    """Mission time of position, velocity and attitude, seconds."""
    position: list[float | None] | None = None
    """Metres east, north and up of home."""
    velocity: list[float | None] | None = None
    """m/s east, north and up."""
    yaw: float | None = None
    """Radians counter-clockwise from east."""
    roll: float | None = None
    """Radians, positive with the right side down."""
    pitch: float | None = None
    """Radians, positive with the nose down."""
    battery: float | None = None
    """Charge left, 0 to 1."""
    outlook: OutlookOut | None = None
    """How far the battery lasts; null while that is not known, or of no meaning."""
    latitude: float | None = None
    longitude: float | None = None
    altitude: float | None = None
    position_sigma: float | None = None
    """Metres, one standard deviation of latitude and longitude; null if unknown."""
    satellites: int | None = None
    """Satellites behind the global position; null if unknown."""
    traffic: list[TrafficOut] = Field(default_factory=list)
    """Other aircraft, the nearest first."""

    @classmethod
    def of(cls, status: MissionStatus, vehicle: VehicleState | None) -> StatusOut:
        """Convert the status, and the vehicle's state if there is one."""
        mission = cls(
            time=seconds(status.stamp),
            state=status.state.value,
            reason=status.reason,
            target=status.target.id if status.target else None,
            pending=[waypoint.id for waypoint in status.pending],
            visited=list(status.visited),
            given_up=list(status.given_up),
            waypoints_visited=status.waypoint_counts[0],
            waypoints_known=status.waypoint_counts[1],
            distance=status.distance,
            faults=list(status.faults),
            pilot=status.pilot,
            outlook=_outlook(status),
            places={one.id: (one.x, one.y, one.z) for one in _ahead(status)},
        )
        if vehicle is None:
            return mission
        odometry, fix = vehicle.odometry, vehicle.gps
        return mission.model_copy(
            update={
                "mode": vehicle.mode.value,
                "measured": seconds(vehicle.stamp),
                "position": [_known(float(axis)) for axis in odometry.position],
                "velocity": [_known(float(axis)) for axis in odometry.velocity],
                "yaw": _known(odometry.yaw),
                "roll": _known(odometry.roll),
                "pitch": _known(odometry.pitch),
                "battery": _known(vehicle.battery.fraction),
                "latitude": _known(fix.latitude) if fix else None,
                "longitude": _known(fix.longitude) if fix else None,
                "altitude": _known(fix.altitude) if fix else None,
                "position_sigma": (_known(fix.horizontal_sigma) or None) if fix else None,
                "satellites": (fix.satellites or None) if fix else None,
                "traffic": [TrafficOut.of(one) for one in vehicle.traffic],
            }
        )


def _outlook(status: MissionStatus) -> OutlookOut | None:
    known = status.outlook
    if known is None or not math.isfinite(known.plan + known.hover):
        return None
    return OutlookOut(plan=known.plan, returns_at=known.returns_at, hover=known.hover)


def _ahead(status: MissionStatus) -> tuple[Waypoint, ...]:
    """The target and what comes after it."""
    return (status.target, *status.pending) if status.target else status.pending


def _known(value: float) -> float | None:
    """Replace a value that is not finite by None, because JSON has no NaN."""
    return value if math.isfinite(value) else None
