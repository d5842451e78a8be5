"""Messages to a page about a flight's state and pictures, live as of a recording.

Each message is one JSON object. Where `blob` is true, the bytes of its picture follow it.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.waypoints import FollowedTarget
from aerodaas.protocol.base import AnswerModel
from aerodaas.protocol.schemas import MissionOut

__all__ = [
    "DepthItem",
    "EndMessage",
    "FoundItem",
    "GroundPlace",
    "ItemMessage",
    "LeftOutMessage",
    "PictureItem",
    "StateMessage",
    "TargetItem",
]

GroundPlace = tuple[float, float, float, float, float, float]
"""Metres east, north and up; standard deviations of the place along both axes of its ellipse,
metres; direction of the longer one, radians counter-clockwise from east."""


class PictureItem(AnswerModel):
    """A picture of a camera; its bytes follow the message."""

    is_: Literal["Picture"] = Field("Picture", alias="is")
    header: Header
    format: Literal["jpeg", "h264"]
    depth: bool
    """Whether the camera measured depth with it."""
    bytes: tuple[int]
    """Length of the picture."""


class DepthItem(AnswerModel):
    """The depth measured with a picture, as a grey PNG whose bytes follow the message."""

    is_: Literal["Depth"] = Field("Depth", alias="is")
    header: Header
    range: float
    """Metres at which the colours end."""
    bytes: tuple[int]
    """Length of the PNG."""


class TargetItem(AnswerModel):
    """Target that a drone follows, in the frame that its command was made from."""

    is_: Literal["Target"] = Field("Target", alias="is")
    header: Header
    of: FollowedTarget


class FoundItem(AnswerModel):
    """Detections of an analysis in a frame."""

    is_: Literal["Detections"] = Field("Detections", alias="is")
    of: Detections


class ItemMessage(AnswerModel):
    """An item of one of the flight's streams."""

    kind: Literal["item"]
    stream: str
    stamp: int
    """Mission time at which the stream carried it, nanoseconds."""
    captured: int
    """Host time of capture, nanoseconds; of a recording, mission time."""
    item: Annotated[PictureItem | DepthItem | TargetItem | FoundItem, Field(discriminator="is_")]
    blob: bool
    key: bool = False
    """Whether decoding of a video can begin with this picture."""
    places: list[GroundPlace | None] = Field(default_factory=list)
    """Place on the ground of each detection, best first; null where it is not known."""


class StateMessage(AnswerModel):
    """The newest state of a mission in flight."""

    kind: Literal["mission"]
    now: int
    """Host time of the server, nanoseconds."""
    mission: MissionOut


class LeftOutMessage(AnswerModel):
    """In place of an item that cannot be sent."""

    kind: Literal["left_out"]
    stream: str
    reason: str


class EndMessage(AnswerModel):
    """The mission is over; nothing follows."""

    kind: Literal["end"]
