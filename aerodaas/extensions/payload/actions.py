"""What a drone does at a waypoint with gimbal and camera, or on the way there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from annotated_types import Ge, Le, Unit

from aerodaas.errors import InvalidWaypointError
from aerodaas.messages.actions import Action, Number, Place
from aerodaas.messages.serialization.json_types import StrictlyTyped
from aerodaas.messages.serialization.records import shared_pickle

__all__ = [
    "LEAST_TRIGGER",
    "AimGimbal",
    "LookAt",
    "RecordVideo",
    "SetLens",
    "TakePhoto",
    "TriggerPhotos",
]

LEAST_TRIGGER = 0.1
"""Metres, and seconds, between two pictures: no camera is faster than its drone's loop."""
_HALF_TURN = 3.1416
"""pi, and the rounding of who writes it by hand."""

Angle: TypeAlias = Annotated[Number, Ge(-_HALF_TURN), Le(_HALF_TURN), Unit("radians")]
Percent: TypeAlias = Annotated[Number, Ge(0.0), Le(100.0), Unit("percent")]


@shared_pickle
@dataclass(frozen=True, slots=True)
class TriggerPhotos(Action):
    """Take pictures on the way to the waypoint, by distance or by time, without a stop."""

    purpose: ClassVar[str] = "takes pictures"
    order: ClassVar[int] = 1
    keywords: ClassVar[tuple[str, ...]] = ("trigger_distance", "trigger_interval")
    stops: ClassVar[bool] = False
    distance: Annotated[Number, Ge(LEAST_TRIGGER), Unit("metres")] | None = None
    """Metres between pictures along the straight line from where the way begins."""
    interval: Annotated[Number, Ge(LEAST_TRIGGER), Unit("seconds")] | None = None
    """Seconds between pictures, on the way and during the stay."""
    type: Literal["trigger_photos"] = field(default="trigger_photos", repr=False)

    @classmethod
    def from_keywords(cls, given: Mapping[str, Any]) -> Iterator[Action]:
        """One for a distance, or an interval."""
        triggers = given.get("trigger_distance"), given.get("trigger_interval")
        if triggers != (None, None):
            yield cls(*triggers)

    def __post_init__(self) -> None:
        """Refuse both, or none."""
        Action.__post_init__(self)
        if (self.distance is None) == (self.interval is None):
            raise InvalidWaypointError("give it trigger_distance or trigger_interval, not both")


@shared_pickle
@dataclass(frozen=True, slots=True)
class LookAt(Action):
    """Keep the gimbal, or the nose where the gimbal cannot turn, on a place.

    From the way to the waypoint on, until one has another place or turns the gimbal.
    """

    purpose: ClassVar[str] = "turns the gimbal"
    order: ClassVar[int] = 1
    keywords: ClassVar[tuple[str, ...]] = ("look_at",)
    stops: ClassVar[bool] = False
    x: Number
    """East or latitude, counted as the waypoint's own x is."""
    y: Number
    """North or longitude, counted as the waypoint's own y is."""
    z: Number
    """Height in metres, counted as the waypoint's own z is."""
    type: Literal["look_at"] = field(default="look_at", repr=False)

    @classmethod
    def from_keywords(cls, given: Mapping[str, Any]) -> Iterator[Action]:
        """One for a place."""
        place = given["look_at"]
        if place is None:
            return
        if not (isinstance(place, tuple | list) and len(place) == len("xyz")):
            raise InvalidWaypointError(f"look_at must be three numbers (x, y, z), not {place!r}")
        yield cls(*place)

    @property
    def slot(self) -> str:
        """The gimbal."""
        return "gimbal"

    @property
    def place(self) -> Place:
        """Point of interest: a waypoint has one."""
        return self.x, self.y, self.z

    def moved(self, place: Place) -> LookAt:
        """Look at another place."""
        return LookAt(*place)


@shared_pickle
@dataclass(frozen=True, slots=True)
class AimGimbal(Action):
    """Turn the gimbal on the way to the waypoint."""

    purpose: ClassVar[str] = "turns the gimbal"
    order: ClassVar[int] = 1
    keywords: ClassVar[tuple[str, ...]] = ("gimbal_pitch", "gimbal_yaw")
    pitch: Angle = 0.0
    """0 at the horizon, negative downwards: -pi/2 looks straight down."""
    yaw: Angle = 0.0
    """From the nose, counter-clockwise."""
    type: Literal["aim_gimbal"] = field(default="aim_gimbal", repr=False)

    @classmethod
    def from_keywords(cls, given: Mapping[str, Any]) -> Iterator[Action]:
        """One for an angle; the other is 0 where it is not given."""
        pitch, yaw = given.get("gimbal_pitch"), given.get("gimbal_yaw")
        if (pitch, yaw) != (None, None):
            yield cls(0.0 if pitch is None else pitch, 0.0 if yaw is None else yaw)

    @property
    def slot(self) -> str:
        """The gimbal."""
        return "gimbal"


@shared_pickle
@dataclass(frozen=True, slots=True)
class SetLens(Action):
    """Set the camera's zoom and focus on the way to the waypoint; None leaves one as it is."""

    purpose: ClassVar[str] = "sets the camera's lens"
    order: ClassVar[int] = 1
    keywords: ClassVar[tuple[str, ...]] = ("zoom", "focus")
    zoom: Percent | None = None
    """0 sees most."""
    focus: Percent | None = None
    """0 is near, 100 far."""
    type: Literal["set_lens"] = field(default="set_lens", repr=False)

    @classmethod
    def from_keywords(cls, given: Mapping[str, Any]) -> Iterator[Action]:
        """One for a zoom, a focus or both."""
        lens = given.get("zoom"), given.get("focus")
        if lens != (None, None):
            yield cls(*lens)


@shared_pickle
@dataclass(frozen=True, slots=True)
class TakePhoto(Action):
    """Take one picture at the waypoint, once the gimbal looks where it is to."""

    purpose: ClassVar[str] = "takes pictures"
    order: ClassVar[int] = 1
    keywords: ClassVar[tuple[str, ...]] = ("photo",)
    type: Literal["take_photo"] = field(default="take_photo", repr=False)

    @classmethod
    def from_keywords(cls, given: Mapping[str, Any]) -> Iterator[Action]:
        """One for `photo=True`."""
        photo = given["photo"]
        if not isinstance(photo, bool):
            raise InvalidWaypointError(f"photo must be True or False, not {photo!r}")
        if photo:
            yield cls()


@shared_pickle
@dataclass(frozen=True, slots=True)
class RecordVideo(Action):
    """Begin or end the camera's recording on its own card, at the waypoint after the picture.

    A recording that the mission has begun ends with it.
    """

    purpose: ClassVar[str] = "begins or ends a video"
    order: ClassVar[int] = 1
    keywords: ClassVar[tuple[str, ...]] = ("video",)
    on: Annotated[bool, StrictlyTyped()] = True
    """Whether it begins."""
    type: Literal["record_video"] = field(default="record_video", repr=False)

    @classmethod
    def from_keywords(cls, given: Mapping[str, Any]) -> Iterator[Action]:
        """One for `video=True` and for `video=False`."""
        if (video := given["video"]) is not None:
            yield cls(video)

    def __post_init__(self) -> None:
        """Refuse what is no flag."""
        on: object = self.on
        if not isinstance(on, bool):
            raise InvalidWaypointError(f"video must be True, False or None, not {on!r}")
