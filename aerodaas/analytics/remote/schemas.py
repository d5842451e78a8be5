"""What the remote control says and hears, as JSON; units as everywhere (metres, seconds)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.mission.commands import Answer
from aerodaas.types.clock import seconds
from aerodaas.types.status import MissionStatus
from aerodaas.types.vehicle import VehicleState
from aerodaas.types.waypoints import DEFAULT_PRIORITY, NavigationType, SchedulingType, Waypoint

__all__ = ["AnswerOut", "StatusOut", "WaypointIn", "WaypointsIn"]

Number = Annotated[float, Field(allow_inf_nan=False)]
_MOST_WAYPOINTS = 1000


class _Strict(BaseModel):
    """Numbers are JSON numbers, not text; unknown keys are mistakes, not wishes."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class WaypointIn(_Strict):
    """One waypoint, as in `aerodaas.Waypoint`."""

    id: Annotated[str, Field(min_length=1, max_length=64)]
    x: Number
    y: Number
    z: Number
    hover_duration: Annotated[Number, Field(ge=0)] = 0.0
    waypoint_type: Literal["relative", "local", "global"] = "relative"
    yaw: Number | None = None
    speed: Annotated[Number, Field(gt=0)] | None = None
    priority: int = DEFAULT_PRIORITY
    deadline: Number | None = None


class WaypointsIn(_Strict):
    """Waypoints to add to the mission."""

    waypoints: Annotated[list[WaypointIn], Field(min_length=1, max_length=_MOST_WAYPOINTS)]
    ordered: bool = True
    """Keep their order whatever the scheduler would like."""
    index: Annotated[int, Field(ge=0)] | None = None
    """Waypoints of the same priority to visit before these."""

    @field_validator("waypoints")
    @classmethod
    def _distinct(cls, waypoints: list[WaypointIn]) -> list[WaypointIn]:
        ids = [waypoint.id for waypoint in waypoints]
        twice = sorted({name for name in ids if ids.count(name) > 1})
        if twice:
            message = f"more than one waypoint is called {', '.join(twice)}"
            raise ValueError(message)
        return waypoints

    def navigation(self) -> AeroNavigation:
        """The waypoints as navigation; raises InvalidWaypointError for what no drone can fly."""
        return AeroNavigation(
            NavigationType.ANALYTICS_DRIVEN,
            [Waypoint(**waypoint.model_dump()) for waypoint in self.waypoints],
            SchedulingType.ORDERED if self.ordered else SchedulingType.UNORDERED,
        )


class AnswerOut(BaseModel):
    """What the mission, or the service in its place, says to a command."""

    accepted: bool
    text: str = ""
    refused: Mapping[str, str] = Field(default_factory=dict)
    """Reason by waypoint id, for the waypoints that were not taken."""

    @classmethod
    def of(cls, answer: Answer) -> AnswerOut:
        """Put the mission's answer into words for JSON."""
        return cls(accepted=answer.accepted, text=answer.text, refused=dict(answer.refused))


class StatusOut(BaseModel):
    """The mission and the vehicle at one moment; a figure that nobody knows is null."""

    time: float
    """Mission time, seconds."""
    state: str
    """One of the 13 states of `MissionState`."""
    reason: str
    target: str | None
    """Waypoint being flown to or hovered at."""
    pending: list[str]
    visited: list[str]
    given_up: list[str]
    distance: float
    """Metres flown."""
    faults: list[str]
    position: list[float | None] | None = None
    """Metres east, north and up of home."""
    velocity: list[float | None] | None = None
    """m/s east, north and up."""
    yaw: float | None = None
    """Radians counter-clockwise from east."""
    battery: float | None = None
    """Charge left, 0 to 1."""
    latitude: float | None = None
    longitude: float | None = None
    altitude: float | None = None

    @classmethod
    def of(cls, status: MissionStatus, vehicle: VehicleState | None) -> StatusOut:
        """Put what is known into JSON's terms."""
        mission = cls(
            time=seconds(status.stamp),
            state=status.state.value,
            reason=status.reason,
            target=status.target.id if status.target else None,
            pending=[waypoint.id for waypoint in status.pending],
            visited=list(status.visited),
            given_up=list(status.given_up),
            distance=status.distance,
            faults=list(status.faults),
        )
        if vehicle is None:
            return mission
        odometry, fix = vehicle.odometry, vehicle.gps
        return mission.model_copy(
            update={
                "position": [_known(float(axis)) for axis in odometry.position],
                "velocity": [_known(float(axis)) for axis in odometry.velocity],
                "yaw": _known(odometry.yaw),
                "battery": _known(vehicle.battery.fraction),
                "latitude": _known(fix.latitude) if fix else None,
                "longitude": _known(fix.longitude) if fix else None,
                "altitude": _known(fix.altitude) if fix else None,
            }
        )


def _known(value: float) -> float | None:
    """JSON has no NaN."""
    return value if math.isfinite(value) else None
