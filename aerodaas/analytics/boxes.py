"""Base class of analyses of bounding boxes, from a detector's stream or a camera's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, TypeAlias, TypeVar

from aerodaas.analytics.base import Analytics, Context
from aerodaas.analytics.models import DETECTOR_CLASSES
from aerodaas.errors import GraphError
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Frame
from aerodaas.messages.readings import Alert

__all__ = ["BoxAnalytics", "shipped_detector"]

O_co = TypeVar("O_co", covariant=True)


def shipped_detector(
    owner: str, labels: Sequence[str], also: Sequence[str] = ()
) -> Analytics[Detections]:
    """Create the detector that ships, for those of some labels that it has classes for.

    Args:
        owner: Name of the analysis that uses it, for the error.
        labels: Labels that the analysis takes, of which the detector must have a class for one.
        also: Further classes to detect.

    Raises:
        GraphError: If it has a class for none of `labels`.
        ModelError: If its file is missing.
    """
    known = [label for label in labels if label in DETECTOR_CLASSES]
    if not known:
        message = (
            f"{owner} takes boxes, not frames: the detector that ships knows no "
            f"{' or '.join(labels)}; analyse the camera with an OnnxDetector of your own first, "
            "or pass one as detector="
        )
        raise GraphError(message)
    # onnxruntime is slow to import.
    from aerodaas.analytics.detection.detector import OnnxDetector  # noqa: PLC0415

    return OnnxDetector(classes=[*known, *(label for label in also if label not in known)])


class BoxAnalytics(Analytics[O_co]):
    """An analysis of boxes; subclasses implement `examine`.

    On a camera's stream it runs `detector`, or the shipped one, itself.
    """

    Detector: TypeAlias = Analytics[Detections]
    accepts: ClassVar[tuple[type, ...]] = (Detections, Frame)
    also: ClassVar[tuple[str, ...]] = ()
    """Labels besides its own that the shipped detector finds for it."""

    def __init__(self, labels: Sequence[str], detector: Detector | None) -> None:
        """Select the boxes with one of `labels`; `detector` is for camera streams."""
        self.labels = (labels,) if isinstance(labels, str) else tuple(labels)
        self.detector = detector
        self._explained = False

    def _prepare_for(self, item: type) -> None:
        if issubclass(item, Frame):
            self.detector = self.detector or shipped_detector(
                type(self).__name__, self.labels, self.also
            )
            self.isolated = True

    def examine(self, boxes: Detections, context: Context) -> O_co | None:
        """Turn the boxes of one frame into a result.

        Args:
            boxes: Boxes of the frame.
            context: Services of its node.

        Returns:
            The result to publish, or None for no result.
        """
        raise NotImplementedError

    def open(self) -> None:
        """Open the detector, if any."""
        if self.detector is not None:
            self.detector.open()

    def close(self) -> None:
        """Close the detector, if any."""
        if self.detector is not None:
            self.detector.close()

    def process(self, item: Detections | Frame, context: Context) -> O_co | None:
        """Turn one frame, or its boxes, into a result.

        Args:
            item: Frame, which is given to the detector, or the boxes of one.
            context: Services of its node.

        Returns:
            The result to publish, or None for no result.
        """
        if not isinstance(item, Frame):
            return self.examine(item, context)
        found = self.detector.process(item, context) if self.detector is not None else None
        return None if found is None else self.examine(found, context)

    def explain_once(self, boxes: Detections, context: Context) -> None:
        """Publish one alert that names the missing calibration or height.

        Args:
            boxes: Boxes of a frame without calibration or height.
            context: Services of its node.
        """
        if self._explained:
            return
        self._explained = True
        lack = (
            "is not calibrated; give the sensor its horizontal_fov"
            if boxes.camera is None
            else "does not know the drone's height at capture"
        )
        text = f"{boxes.header.source} {lack}. Distances on the ground are unknown."
        context.alert(Alert(boxes.header, "camera_uncalibrated", text))
