"""PoseAnalytics: detection of people and their joints, first boxes, then the keypoints in each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.base import Analytics, Context, ResourceUse
from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.detection.keypoints import KeypointModel
from aerodaas.analytics.models import POSE
from aerodaas.config.checked import Count, PositiveFraction
from aerodaas.errors import ConfigError
from aerodaas.geometry.frames import Box
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame

__all__ = ["PoseAnalytics", "body_around"]

_PEOPLE = ("person",)
_VESTS = ("vest", "hazard vest")

_ABOVE, _BELOW = 0.55, 1.6
"""Distances from an upright person's vest to the crown and to the soles, in heights of the vest."""

_LYING = 3.0
"""Greatest length of a lying person, in lengths of the vest."""

_SAME, _SMALLER = 0.6, 0.35
"""Least shared fraction of the smaller of two boxes of one body, and least ratio of their areas."""

_TRUSTED = 0.35
"""Least confidence of the keypoints that determine the extent of a body."""

_LEAST = 5
"""Least number of such keypoints."""

_ROOM = 0.08
"""Distance from the outermost joint to the outline, as a fraction of the body's extent."""


class PoseAnalytics(Analytics[Detections]):
    """Detects people and their 17 COCO keypoints, with two networks in sequence.

    The detector finds boxes of people and of vests; a vest outside every person's box indicates
    an undetected person. The keypoint network then processes a square crop around each of the
    `most` largest people, all in one run. Boxes of one body, with an arm and without, count as
    one. Both networks run in one process and are one task of the analytics scheduler.
    """

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = Detections
    isolated = True
    scheduled = True
    concurrent = True
    resources: ClassVar[Mapping[str, ResourceUse]] = {"model": "model"}

    def __init__(
        self,
        model: str | Path = POSE,
        *,
        detector: OnnxDetector | None = None,
        most: Count = 5,
        min_score: PositiveFraction = 0.3,
        providers: Sequence[str] | None = None,
        threads: int | None = None,
    ) -> None:
        """Read the models.

        Args:
            model: ONNX file of the keypoint network, as made by `python -m tools.training pose` or
                an RTMPose, or the name of a fetched one (`aerodaas models list`); by default the
                shipped one.
            detector: Detector of `person` or `vest`; by default the shipped one.
            most: Greatest number of people per frame, 1 or more.
            min_score: Least confidence of the default detector's boxes, above 0 to 1.
            providers: As in `OnnxDetector`.
            threads: As in `OnnxDetector`.

        Raises:
            ModelError: If a file or setting is unsuitable.
            ConfigError: If `most` is below 1.
        """
        if most < 1:
            raise ConfigError(f"most must be 1 or more, not {most}")
        self.most = most
        self.detector = detector or OnnxDetector(
            classes=[*_PEOPLE, _VESTS[0]],
            min_score=min_score,
            providers=providers,
            threads=threads,
        )
        self.keypoints = KeypointModel(model, providers=providers, threads=threads)

    def open(self) -> None:
        """Load both networks."""
        self.detector.open()
        self.keypoints.open()

    def close(self) -> None:
        """Release both networks."""
        self.detector.close()
        self.keypoints.close()

    def process(self, item: Frame, context: Context) -> Detections:
        """Detect the people in one frame, with keypoints of (17, 3): u, v, confidence."""
        del context
        return self.detect(item)

    def detect(self, frame: Frame) -> Detections:
        """Detect the people in `frame`, with keypoints of (17, 3): u, v, confidence."""
        found = self.detector.detect([frame])[0]
        people = _merged(found.labelled(*_PEOPLE))
        for vest in found.labelled(*_VESTS):
            if not any(_holds(person.box, vest.centre) for person in people):
                people.append(self._wearer(frame, vest))
        people = sorted(people, key=lambda one: -one.area)[: self.most]
        if not people:
            return Detections.of(frame, ())
        joints = self.keypoints.find(frame.image, [one.box for one in people])
        return Detections.of(
            frame,
            [
                Detection(one.box, _PEOPLE[0], one.score, keypoints=points)
                for one, points in zip(people, joints, strict=True)
            ],
        )

    def _wearer(self, frame: Frame, vest: Detection) -> Detection:
        """Estimate the person around a vest, refined by the keypoints found there."""
        guess = body_around(vest.box)
        (joints,) = self.keypoints.find(frame.image, [guess])
        size = (frame.width, frame.height)
        box = _clipped(_extent(joints) or guess, size)
        return Detection(box, _PEOPLE[0], vest.score)


def _merged(people: Sequence[Detection]) -> list[Detection]:
    """Merge the boxes of each body into their union, best first."""
    kept: list[Detection] = []
    for one in people:
        same = next((at for at, other in enumerate(kept) if _alike(one.box, other.box)), None)
        if same is None:
            kept.append(one)
            continue
        low = np.minimum(one.box, kept[same].box)[:2].tolist()
        high = np.maximum(one.box, kept[same].box)[2:].tolist()
        kept[same] = Detection((*low, *high), kept[same].label, kept[same].score)
    return kept


def _alike(one: Box, other: Box) -> bool:
    """Whether most of the smaller box lies in the other, which is not much larger."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    inner = max(0.0, width) * max(0.0, height)
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (one, other)]
    return inner > _SAME * min(areas) and min(areas) > _SMALLER * max(areas)


def body_around(vest: Box) -> Box:
    """Estimate the box of a vest's wearer, upright or lying."""
    left, top, right, bottom = vest
    wide, high = right - left, bottom - top
    if high >= wide:
        return left - 0.5 * wide, top - _ABOVE * high, right + 0.5 * wide, bottom + _BELOW * high
    middle, half = ((left + right) / 2, (top + bottom) / 2), _LYING * wide / 2
    return middle[0] - half, middle[1] - half, middle[0] + half, middle[1] + half


def _extent(joints: NDArray[np.float32]) -> Box | None:
    """Box around the joints of sufficient confidence; None if they are too few."""
    places = joints[joints[:, 2] >= _TRUSTED, :2].astype(float)
    if len(places) < _LEAST:
        return None
    low, high = places.min(axis=0), places.max(axis=0)
    room = _ROOM * float((high - low).max())
    left, top = (low - room).tolist()
    right, bottom = (high + room).tolist()
    return left, top, right, bottom


def _clipped(box: Box, size: tuple[int, int]) -> Box:
    left, top, right, bottom = box
    return max(0.0, left), max(0.0, top), min(float(size[0]), right), min(float(size[1]), bottom)


def _holds(box: Box, point: tuple[float, float]) -> bool:
    return box[0] <= point[0] <= box[2] and box[1] <= point[1] <= box[3]
