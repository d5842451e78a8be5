"""Analyses for test applications."""

from __future__ import annotations

import cv2
import numpy as np

from aerodaas.analytics.base import Analytics, Context
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame

__all__ = ["LimeVestFinder"]

_LEAST = 20
"""Pixels."""


class LimeVestFinder(Analytics[Detections]):
    """Finds the lime vest of the simulated campus by its colour."""

    accepts = (Frame,)
    produces = Detections

    def process(self, item: Frame, context: Context) -> Detections:
        """Box the largest lime thing."""
        del context
        hues = cv2.cvtColor(item.image, cv2.COLOR_BGR2HSV)
        lime = cv2.inRange(hues, np.array([36, 190, 100]), np.array([44, 255, 255]))
        # The vest's reflecting stripes part it.
        whole = cv2.morphologyEx(lime, cv2.MORPH_CLOSE, np.ones((25, 9), np.uint8))
        count, _, boxes, _ = cv2.connectedComponentsWithStats(whole)
        if count == 1:
            return Detections.of(item, [])
        left, top, width, height, area = max(boxes[1:], key=lambda box: int(box[4]))
        if area < _LEAST:
            return Detections.of(item, [])
        box = (float(left), float(top), float(left + width), float(top + height))
        return Detections.of(item, [Detection(box, "vest", 0.9)])
