"""CrowdDensityAnalytics: how many people stand how close together, by the camera's geometry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.base import Context
from aerodaas.analytics.boxes import BoxAnalytics
from aerodaas.analytics.people.debounce import Debounce
from aerodaas.following.ground import GroundView
from aerodaas.types.data import Alert, Detections, Readings
from aerodaas.types.errors import ConfigError

__all__ = ["CrowdDensityAnalytics"]

_CELL = 1.0
"""Metres; the peak is that of a square of two cells by two."""
_CUT = 0.03
"""Part of the picture's height within which a box ends at its edge, the feet out of the picture."""


class CrowdDensityAnalytics(BoxAnalytics[Readings]):
    """Counts people and says how dense they stand on the ground, in people for each m².

    Each result has `count` (all boxes), and where the camera is calibrated and the drone's height
    known: `area` (m² of ground in the picture within `farthest` metres), `density` (people on
    that ground for each m² of it) and `peak` (the densest 2 m x 2 m). The ground is taken for
    flat, at the height of home; people stand where their boxes end. Whose feet the picture's
    lower edge cuts off is counted, but stands nowhere.
    """

    produces: ClassVar[type] = Readings

    def __init__(
        self,
        *,
        limit: float = 2.0,
        farthest: float = 30.0,
        labels: Sequence[str] = ("person",),
        needed: int = 3,
        of: int = 5,
        detector: BoxAnalytics.Detector | None = None,
    ) -> None:
        """Alert when `needed` of the last `of` frames show a peak above `limit` people for each m².

        `farthest` (metres) bounds the ground that counts: farther feet are too uncertain.
        Raises ConfigError for numbers that cannot be.
        """
        for name, value in (("limit", limit), ("farthest", farthest)):
            if not 0.0 < value < math.inf:
                raise ConfigError(f"{type(self).__name__}: {name} must be above 0, not {value}")
        super().__init__(labels, detector)
        self.limit = limit
        self.farthest = farthest
        self._crowded = Debounce(needed, of)

    def examine(self, boxes: Detections, context: Context) -> Readings:
        """Count the people of one frame."""
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
    """People for each m² in the fullest square of two cells by two."""
    cells = np.floor(feet / _CELL).astype(np.int64)
    corners = np.concatenate([cells - [dx, dy] for dx in (0, 1) for dy in (0, 1)])
    if not len(corners):
        return 0.0
    _, counts = np.unique(corners, axis=0, return_counts=True)
    return float(counts.max()) / (2 * _CELL) ** 2
