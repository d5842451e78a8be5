"""What a page is told of a recorded flight: all that it draws of it but the pictures.

Units are those of `schemas`. Lists are in the order of time, and bounded; what exceeds a bound is
thinned out or counted in `untold`.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field

from aerodaas.messages.mission import MissionPlan, MissionStatus
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.protocol.base import AnswerModel
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import AnalyticsOut, StreamKind

__all__ = ["PlaybackOut", "RecordedOut", "TrackOut"]


class TrackOut(AnswerModel):
    """One robot's flight: its messages, thinned out."""

    states: list[VehicleState]
    """Without truth, complaints and further figures; other aircraft stand in one a second."""
    statuses: list[MissionStatus]
    """One for each change, and one a second; the waypoints after the target are the plan's last."""
    ahead: list[int]
    """Number of waypoints after the target, by status."""
    plans: list[MissionPlan]
    """Plans that differ from those before them in other than their beginning."""


class RecordedOut(AnswerModel):
    """A recorded flight."""

    name: str
    began: float
    """Moment of mission time 0."""
    begin: float
    end: float
    """Mission time of its first and last message, seconds."""
    pictured: float | None = None
    """Mission time at which its first picture was captured, seconds; null without any."""
    remark: str
    """What of the recording could not be read; empty if all could."""
    environment: dict[str, Any]
    """Where it was flown, as in `FleetOut`; empty if that was not recorded."""
    scenery: SceneryOut = SceneryOut()
    """What lies below it on the map; of a simulated world one of those that ship."""
    tracks: dict[str, TrackOut]
    """By robot."""
    alerts: list[Alert]
    """Without their figures."""
    analytics: list[AnalyticsOut]
    streams: dict[str, StreamKind]
    """Streams of pictures and of what was found in them, by name."""


class PlaybackOut(AnswerModel):
    """How far a recording has been read, and the flight once it was."""

    read: float = Field(ge=0, le=1)
    flight: RecordedOut | None = None
