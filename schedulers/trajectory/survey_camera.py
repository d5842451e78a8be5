"""A camera that photographs an area: what it sees of the ground, and how far apart pictures lie.

The formulas are those of flight planning for vertical photographs of flat ground (Wolf, Dewitt,
Wilkinson, "Elements of Photogrammetry", 4th edition, McGraw-Hill 2014, chapter 18): the picture
covers G = H * sensor / focal length, which is 2 H tan(field of view / 2), and neighbouring pictures
lie G * (1 - overlap) apart. QGroundControl's surveys count in the same way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from aerodaas.errors import SchedulerError

__all__ = ["SurveyCamera"]

_HALF_TURN = math.pi


@dataclass(frozen=True)
class SurveyCamera:
    """A camera that looks straight down, the wide side of its picture across the flight.

    Raises SchedulerError for angles and shares that are none.
    """

    horizontal_fov: float
    """Radians across the picture, 0 to pi."""
    aspect: float = 16 / 9
    """Width over height of its pictures, in pixels."""
    front_overlap: float = 0.75
    """Share of a picture, 0 to less than 1, that the next one on the same line has in common."""
    side_overlap: float = 0.65
    """The same with the picture beside it on the next line."""
    gimbal: bool = True
    """Whether a gimbal is to be turned straight down; False for a camera that is mounted so."""
    pixels: int | None = None
    """Pixels across its picture; None where that is of no interest: it has no resolution then."""
    interval: float | None = None
    """Seconds that it needs from one picture to the next; None where that is not known."""

    zooms: bool = False
    """Whether its lens has to be set to its widest, which `horizontal_fov` is."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not (0.0 < self.horizontal_fov < _HALF_TURN and self.aspect > 0.0):
            raise SchedulerError(
                "a camera's field of view is in radians, above 0 and below pi, and its aspect "
                f"positive, not {self.horizontal_fov} and {self.aspect}"
            )
        for overlap in (self.front_overlap, self.side_overlap):
            if not 0.0 <= overlap < 1.0:
                raise SchedulerError(f"an overlap is 0 to less than 1, not {overlap}")
        for what, value in (("pixels", self.pixels), ("interval", self.interval)):
            if value is not None and not value > 0.0:
                raise SchedulerError(f"a camera's {what} must be positive, not {value}")

    def footprint(self, height: float) -> tuple[float, float]:
        """Width and depth in metres of the ground that it sees from `height` metres above it."""
        width = 2.0 * height * math.tan(self.horizontal_fov / 2.0)
        return width, width / self.aspect

    def line_spacing(self, height: float) -> float:
        """Metres between two lines of the survey."""
        return self.footprint(height)[0] * (1.0 - self.side_overlap)

    def trigger_distance(self, height: float) -> float:
        """Metres between two pictures on a line."""
        return self.footprint(height)[1] * (1.0 - self.front_overlap)

    def ground_resolution(self, height: float) -> float | None:
        """Metres of ground in one pixel of its picture; None without `pixels`."""
        return None if self.pixels is None else self.footprint(height)[0] / self.pixels

    def height(self, ground_resolution: float) -> float:
        """Metres above the ground from which one pixel shows `ground_resolution` metres of it.

        Raises SchedulerError for a resolution that is none, and without `pixels`.
        """
        if self.pixels is None:
            raise SchedulerError(
                "a height from a ground resolution needs the picture's width in pixels: give the "
                "camera its pixels, or the survey a height"
            )
        if not (ground_resolution > 0.0 and math.isfinite(ground_resolution)):
            raise SchedulerError(
                f"a ground resolution is in metres a pixel and positive, not {ground_resolution}"
            )
        return ground_resolution * self.pixels / (2.0 * math.tan(self.horizontal_fov / 2.0))
