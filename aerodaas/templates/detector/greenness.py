"""A detector of your own: finds the green patches of a picture."""

from typing import ClassVar

import cv2
import numpy as np

from aerodaas import Analytics, Detection, Detections, Frame
from aerodaas.analytics.base import Context

FROM, TO = np.array([42, 110, 40]), np.array([85, 255, 255])
"""Crops: hue (of 180), saturation and value (of 255); grass is yellower and paler."""


class Greenness(Analytics[Detections]):
    """Finds green patches. What it needs, such as a model, it loads in `open`."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    isolated = True  # a process of its own, as a neural network should have

    def __init__(self, least_share: float = 0.01) -> None:
        """Find patches of at least this share of the picture, 0 to 1."""
        self.least_share = least_share

    def process(self, item: Frame, context: Context) -> Detections:  # noqa: ARG002
        """Return one box for each patch, in pixels; its score is how much of the box is green."""
        green = cv2.inRange(cv2.cvtColor(item.image, cv2.COLOR_BGR2HSV), FROM, TO)
        _, _, patches, _ = cv2.connectedComponentsWithStats(green)
        found = [
            Detection((x, y, x + width, y + height), "green", area / (width * height))
            for x, y, width, height, area in patches[1:].tolist()
            if area >= self.least_share * green.size
        ]
        return Detections.of(item, found)
