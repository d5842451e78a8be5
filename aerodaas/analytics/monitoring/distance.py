"""DistanceAnalytics: distance to the nearest object, with an alert when it is too near."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from aerodaas.analytics.base import Context
from aerodaas.analytics.boxes import BoxAnalytics
from aerodaas.analytics.people.debounce import Debounce
from aerodaas.config.checked import Count, Positive
from aerodaas.errors import ConfigError
from aerodaas.following.target import RelativeTarget, TargetSize, sight
from aerodaas.messages.detections import Detections
from aerodaas.messages.readings import Alert, Readings

__all__ = ["SIZES", "DistanceAnalytics"]

SIZES: Mapping[str, TargetSize] = {
    "person": TargetSize(1.7, 0.55),
    "vest": TargetSize(0.6, 0.43),
    "car": TargetSize(1.5, 1.8, widest=4.2),
}
"""Heights and widths of the shipped detector's classes, in metres."""


class DistanceAnalytics(BoxAnalytics[Readings]):
    """Measures the distance along the ground from the drone to the nearest object of known size.

    Each result has `distance` (metres) and `bearing` (radians, positive to the left) of the
    nearest object, and `distance.LABEL` of the nearest of each label; without a detection the
    value is absent. For an object that the image's edges cut on all sides, the distance is an
    upper bound.
    """

    produces: ClassVar[type] = Readings

    def __init__(
        self,
        *,
        limit: Positive = 1.5,
        sizes: Mapping[str, TargetSize | tuple[float, float]] | None = None,
        needed: Count = 2,
        of: Count = 3,
        detector: BoxAnalytics.Detector | None = None,
    ) -> None:
        """Alert when `needed` of the last `of` frames show an object within `limit`.

        Args:
            limit: Distance along the ground, metres.
            sizes: Heights and widths by label, metres; by default those of persons, vests and
                cars. Other labels are ignored.
            needed: Frames that must show the object, 1 to `of`.
            of: Frames that are considered.
            detector: Detector for camera streams; by default the shipped one.

        Raises:
            ConfigError: If a length is not positive and finite, `sizes` is empty, or `needed` is
                not within 1 to `of`.
        """
        given = SIZES if sizes is None else sizes
        self.sizes = {
            label: size if isinstance(size, TargetSize) else TargetSize(*size)
            for label, size in given.items()
        }
        lengths = {"limit": limit}
        for label, size in self.sizes.items():
            lengths |= {f"height of {label}": size.height, f"width of {label}": size.width}
        for name, length in lengths.items():
            if not 0.0 < length < math.inf:
                raise ConfigError(f"{type(self).__name__}: {name} must be above 0 m, not {length}")
        if not self.sizes:
            raise ConfigError(f"{type(self).__name__}: sizes names nothing to look at")
        super().__init__(list(self.sizes), detector)
        self.limit = limit
        self._near = Debounce(needed, of)

    def examine(self, boxes: Detections, context: Context) -> Readings:
        """Measure the distances in one frame.

        Args:
            boxes: Boxes of the frame.
            context: Services of its node.

        Returns:
            Metres to the nearest object of each label, and to the nearest of all with its bearing
            in radians.
        """
        stamp = boxes.header.stamp
        if boxes.camera is None:
            self.explain_once(boxes, context)
            return Readings(stamp, {})
        nearest: dict[str, RelativeTarget] = {}
        for item in boxes.labelled(*self.labels):
            found = sight(item, boxes, self.sizes[item.label])
            known = nearest.get(item.label)
            if found is not None and (known is None or found.distance < known.distance):
                nearest[item.label] = found
        values = {f"distance.{label}": found.distance for label, found in nearest.items()}
        least = min(nearest.items(), key=lambda entry: entry[1].distance, default=None)
        if least is not None:
            values |= {"distance": least[1].distance, "bearing": least[1].bearing}
        self._near.update(stamp, least is not None and least[1].distance < self.limit)
        if self._near.began and least is not None:
            text = f"a {least[0]} is {least[1].distance:.1f} m away, nearer than {self.limit:g} m"
            context.alert(Alert(boxes.header, "too_near", text, values))
        return Readings(stamp, values)
