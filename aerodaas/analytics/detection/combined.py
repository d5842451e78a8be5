"""CombinedDetector: boxes of several detectors as one, each for what it is good at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from aerodaas.analytics.base import Analytics, Context
from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.errors import ConfigError
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Frame

__all__ = ["CombinedDetector"]


class CombinedDetector(Analytics[Detections]):
    """Detects with several networks, one after the other, each for labels of its own.

    ``CombinedDetector([VipDetectionAnalytics(classes=["vest"]), OnnxDetector("yolox-nano",
    classes=["person"])])``. All of them run in one process and are one task of the analytics
    scheduler.
    """

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Detections
    isolated = True
    scheduled = True
    concurrent = True

    def __init__(self, detectors: Sequence[OnnxDetector]) -> None:
        """Combine detectors.

        Args:
            detectors: The detectors, which must find different labels.

        Raises:
            ConfigError: If there is none, one is no `OnnxDetector`, or two find the same label.
        """
        self.detectors = tuple(detectors)
        if not self.detectors:
            raise ConfigError("CombinedDetector needs at least one detector")
        finders: dict[str, OnnxDetector] = {}
        for one in self.detectors:
            if not isinstance(one, OnnxDetector):
                raise ConfigError(
                    f"CombinedDetector takes OnnxDetectors, not {type(one).__name__}: {one!r:.80}"
                )
            for label in one.labels:
                if label in finders:
                    raise ConfigError(
                        f"both {finders[label].path} and {one.path} would find {label}: give each "
                        "detector its classes="
                    )
                finders[label] = one

    def open(self) -> None:
        """Load all networks."""
        for one in self.detectors:
            one.open()

    def close(self) -> None:
        """Release all networks."""
        for one in self.detectors:
            one.close()

    def process(self, item: Frame, context: Context) -> Detections:
        """Detect what each network finds in one frame."""
        del context
        found = (one.detect([item])[0] for one in self.detectors)
        return Detections.of(item, (box for boxes in found for box in boxes))
