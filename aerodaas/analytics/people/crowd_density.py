"""CrowdDensityAnalytics: number and density of people on the ground, by the camera's geometry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.base import Context
from aerodaas.analytics.boxes import BoxAnalytics
from aerodaas.analytics.people.debounce import Debounce
from aerodaas.config.checked import Count, Positive
from aerodaas.errors import ConfigError
from aerodaas.following.ground_point import GroundView
from aerodaas.messages.detections import Detections
from aerodaas.messages.readings import Alert, Readings

__all__ = ["CrowdDensityAnalytics"]

_CELL = 1.0
"""Side of a cell in metres; the peak is measured in squares of two cells by two."""
_CUT = 0.03
"""Distance of a box from the lower edge, in image heights, within which the feet are cut off."""


class CrowdDensityAnalytics(BoxAnalytics[Readings]):
    """Counts people and measures their density on the ground, in people per m².

    Each result has `count` (all boxes), and if the camera is calibrated and the drone's height is
    known: `area` (m² of ground in the image within `farthest` metres), `density` (people per m²
    on that ground) and `peak` (the densest 2 m x 2 m). The ground is assumed to be flat, at the
    height of home; people stand at the lower edges of their boxes. People whose feet are cut off
    by the image's lower edge are counted, but not located.
    """

    produces: ClassVar[type] = Readings

    def __init__(
        self,
        *,
        limit: Positive = 2.0,
        farthest: Positive = 30.0,
        labels: Sequence[str] = ("person",),
        needed: Count = 3,
        of: Count = 5,
        detector: BoxAnalytics.Detector | None = None,
    ) -> None:
        """Alert when `needed` of the last `of` frames show a peak density above `limit`.

        Args:
            limit: Density of people per m².
            farthest: Range of the ground considered, metres; farther feet are too uncertain.
            labels: Labels of the boxes to count.
            needed: Frames that must show the density, 1 to `of`.
            of: Frames that are considered.
            detector: Detector for camera streams; by default the shipped one.

        Raises:
            ConfigError: If a number is out of range.
        """
        for name, value in (("limit", limit), ("farthest", farthest)):
            if not 0.0 < value < math.inf:
                raise ConfigError(f"{type(self).__name__}: {name} must be above 0, not {value}")
        super().__init__(labels, detector)
        self.limit = limit
        self.farthest = farthest
        self._crowded = Debounce(needed, of)

    def examine(self, boxes: Detections, context: Context) -> Readings:
        """Count the people in one frame and measure their density.

        Args:
            boxes: Boxes of the frame.
            context: Services of its node.

        Returns:
            `count`; where the camera is calibrated, `area` in m² and `density` and `peak` in people
            per m².
        """
        people = [
            item for item in boxes.labelled(*self.labels) if all(map(math.isfinite, item.box))
        ]
        values = {"count": float(len(people))}
        try:
            view = GroundView(boxes)
        except ValueError:
            self.explain_once(boxes, context)
            return Readings(boxes.header.stamp, values)
        edges = np.array([item.box for item in people], dtype=np.float64).reshape(-1, 4)
        edges = edges[edges[:, 3] < (1 - _CUT) * boxes.height]
        feet = view.points(np.column_stack([(edges[:, 0] + edges[:, 2]) / 2, edges[:, 3]]))
        feet = feet[np.hypot(*feet.T) <= self.farthest]
        area = view.area(self.farthest)
        values["area"] = area
        values["density"] = len(feet) / area if area > 0 else 0.0
        values["peak"] = _peak(feet)
        self._crowded.update(boxes.header.stamp, values["peak"] > self.limit)
        if self._crowded.began:
            text = f"{values['peak']:.1f} people for each m², above {self.limit:g}"
            context.alert(Alert(boxes.header, "crowd_dense", text, values))
        return Readings(boxes.header.stamp, values)


def _peak(feet: NDArray[np.float64]) -> float:
    """People per m² in the densest square of two cells by two."""
    cells = np.floor(feet / _CELL).astype(np.int64)
    corners = np.concatenate([cells - [dx, dy] for dx in (0, 1) for dy in (0, 1)])
    if not len(corners):
        return 0.0
    _, counts = np.unique(corners, axis=0, return_counts=True)
    return float(counts.max()) / (2 * _CELL) ** 2
