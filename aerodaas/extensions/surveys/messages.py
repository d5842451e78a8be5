"""Requests and answers of a service about surveys.

Units are metres, seconds, radians and m/s in the local ENU frame; a charge is 0 to 1.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator
from typing_extensions import Self

from aerodaas.dataflow.mission_document import DocumentWaypoint
from aerodaas.extensions.surveys.planning import MOST_CORNERS
from aerodaas.protocol.base import AnswerModel, Number, RequestModel
from aerodaas.protocol.schemas import Word

__all__ = ["SurveyIn", "SurveyOut", "SurveyPhotosOut"]

_MOST_METRES = 10_000.0
_Length = Annotated[float, Field(gt=0, le=_MOST_METRES, allow_inf_nan=False)]
_Corner = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]


class SurveyIn(RequestModel):
    """Request of a plan to survey an area; nothing is flown."""

    robot: Word
    area: Annotated[list[tuple[_Corner, _Corner]], Field(min_length=3, max_length=MOST_CORNERS)]
    """Corners, metres east and north."""
    height: _Length | None = None
    """Metres above home; with a camera, `ground_resolution` may be given instead."""
    width: _Length | None = None
    """Metres of ground that are seen across the sweep."""
    field_of_view: Annotated[float, Field(gt=0.02, lt=3.1)] | None = None
    """In the place of a width: of a camera that looks straight down, horizontally, radians."""
    camera: Word | None = None
    """In the place of both: the robot's camera that takes pictures on the way, by its id."""
    overlap: Annotated[float, Field(ge=0, le=0.9)] = 0.2
    """Share of a strip that its neighbour sees, too."""
    front_overlap: Annotated[float, Field(ge=0, le=0.95)] = 0.75
    """Share of a camera's picture that the next one on the same strip shows, too."""
    ground_resolution: Annotated[float, Field(gt=0, le=10)] | None = None
    """Metres of ground in one pixel of the camera's picture, from which the height follows."""
    angle: Number | None = None
    """Direction of the sweeps, counter-clockwise from east; None for the shortest path."""
    speed: Annotated[float, Field(ge=0.1, le=100)] | None = None
    """None for the robot's cruise speed."""
    around: bool = False
    """Fly around no-fly zones within the area; otherwise an area with one is refused."""
    name: Word = "survey"
    """Beginning of the waypoints' ids."""

    @model_validator(mode="after")
    def _wide(self) -> Self:
        ways = (self.width, self.field_of_view, self.camera)
        if sum(one is not None for one in ways) != 1:
            raise ValueError("give either the strip's width, a field_of_view, or a camera")
        if (self.height is None) == (self.ground_resolution is None):
            raise ValueError("give either a height or a ground_resolution")
        if self.ground_resolution is not None and self.camera is None:
            raise ValueError("a ground_resolution is that of a camera: name the camera")
        return self


class SurveyPhotosOut(AnswerModel):
    """Pictures of a survey as they would be taken."""

    places: list[tuple[float, float]]
    """Metres east and north, in order."""
    spacing: float
    """Metres from one to the next on a line."""
    interval: float
    """Seconds from one to the next."""
    line_spacing: float
    """Metres between two lines at most."""
    resolution: float | None
    """Metres of ground in a pixel."""
    warning: str
    """Why some cannot be taken, with the remedy; empty where nothing is known against them."""


class SurveyOut(AnswerModel):
    """A survey as it would be flown; its waypoints are added by `navigation`."""

    waypoints: list[DocumentWaypoint]
    height: float
    """Metres above home."""
    width: float
    """Metres of ground seen across the sweep."""
    angle: float
    sweeps: int
    length: float
    """Metres from the first waypoint to the last."""
    seconds: float
    """From where the drone will come from to the last waypoint."""
    battery: float
    """Charge for the way there, the survey and the way home, by the energy model."""
    available: float | None
    """Charge that is there to spend, less the reserve; None while it is unknown."""
    start: tuple[float, float, float]
    """Where the drone will come from: its last coming waypoint, or where it is."""
    photos: SurveyPhotosOut | None
    """Null without a camera."""
