"""What a page is told of a recorded flight: all that it draws of it but the pictures.

Units are those of `schemas`. Lists are in the order of time, and bounded; what exceeds a bound is
thinned out or counted in `untold`.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field

from aerodaas.messages.mission import BatteryOutlook
from aerodaas.protocol.bases import AnswerModel
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import AnalyticsOut, StatusOut, StreamKind, TrafficOut

__all__ = [
    "AlertOut",
    "GpsOut",
    "HeardOut",
    "PlaceOut",
    "PlaybackOut",
    "RecordedOut",
    "TrackOut",
]


class PlaceOut(AnswerModel):
    """A waypoint of the plan."""

    since: float
    """Mission time, seconds, from which it was known."""
    id: str
    place: tuple[float, float, float]
    """Metres east, north and up of home."""


class AlertOut(AnswerModel):
    """An alert."""

    time: float
    """Mission time, seconds."""
    kind: str
    text: str


class GpsOut(AnswerModel):
    """What a satellite receiver gives, beside the place."""

    satellites: int | None
    position_sigma: float | None
    """Standard deviation of the place along the ground, metres."""


class HeardOut(AnswerModel):
    """The other aircraft that a robot heard of from a time on."""

    since: float
    """Mission seconds, for which the places hold."""
    aircraft: list[TrafficOut]


class TrackOut(AnswerModel):
    """One robot's flight.

    Its status at a time is the last one of `statuses` until then, with the figures of the last
    row until then.
    """

    time: list[float]
    """Mission time of each row, seconds."""
    position: list[tuple[float | None, float | None, float | None]]
    """Metres east, north and up of home, by row."""
    velocity: list[tuple[float | None, float | None, float | None]]
    yaw: list[float | None]
    roll: list[float | None]
    pitch: list[float | None]
    battery: list[float | None]
    distance: list[float]
    outlook: list[BatteryOutlook | None]
    """How far the battery lasts, by row; null where it was not known."""
    gps: list[GpsOut | None]
    """What the satellites give, by row; null without a receiver."""
    statuses: list[StatusOut]
    """One for each change of anything but figures and places, which they do not have."""
    places: list[PlaceOut]
    """Waypoints as they became known; a later one of the same id takes the place of an earlier."""
    traffic: list[HeardOut] = Field(default_factory=list)
    """Other aircraft, at most once a second; an empty one where the last of them was gone."""


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
    alerts: list[AlertOut]
    analytics: list[AnalyticsOut]
    streams: dict[str, StreamKind]
    """Streams of pictures and of what was found in them, by name."""


class PlaybackOut(AnswerModel):
    """How far a recording has been read, and the flight once it was."""

    read: float = Field(ge=0, le=1)
    flight: RecordedOut | None = None
