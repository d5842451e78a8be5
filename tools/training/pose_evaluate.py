"""Figures of an exported keypoint network on held-out people, by part of the body."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.keypoints import KeypointModel
from aerodaas.analytics.people import joints
from tools.training.metrics import similarity
from tools.training.pose_cuts import People

__all__ = ["PARTS", "Placing", "milliseconds_per_person", "placing"]

PARTS = {
    "nose, eyes, ears": joints.FACE,
    "shoulders": joints.SHOULDERS,
    "elbows": joints.ELBOWS,
    "wrists": joints.WRISTS,
    "hips": joints.HIPS,
    "knees": joints.KNEES,
    "ankles": joints.ANKLES,
}

_TRUSTED = 0.35
"""Confidence from which on the gestures' analysis counts a joint as seen."""

_MOVED, _SCALED = 0.05, 0.1
"""Standard deviations of a detector's boxes: of the middle and log side, in sides."""

_VISIBLE = 2
_TIMED_RUNS = 30


@dataclass(frozen=True)
class Placing:
    """Where a network put the joints of n people."""

    errors: NDArray[np.float64]
    """(n, 17) distances in the longer side of the person's box; NaN where none is in sight."""
    confidences: NDArray[np.float64]
    """(n, 17)."""
    likeness: NDArray[np.float64]
    """(n,) COCO's object keypoint similarity."""

    def correct(self, part: slice, share: float) -> float:
        """Share of a part's visible joints within `share` of the box's longer side (PCK)."""
        errors = self.errors[:, part]
        return float((errors[np.isfinite(errors)] <= share).mean())

    def trusted(self, part: slice) -> tuple[float, float]:
        """Share of a part's visible joints that are trusted, and the median error of these."""
        errors, sure = self.errors[:, part], self.confidences[:, part] >= _TRUSTED
        seen = np.isfinite(errors)
        return float(sure[seen].mean()), float(np.median(errors[seen & sure]))


def placing(model: Path, people: People, *, moved: bool = False) -> Placing:
    """Find the joints of all `people` in their true boxes, or in boxes `moved` as a detector's."""
    network = _opened(model)
    rng = np.random.default_rng(0)
    errors, confidences, likeness = [], [], []
    for index in range(len(people)):
        image, box, truth = people[index]
        longest = float((box[2:] - box[:2]).max())
        found = network.find(image, [_box(box, rng if moved else None)])
        away = np.hypot(*(found[0, :, :2] - truth[:, :2]).T) / longest
        errors.append(np.where(truth[:, 2] >= _VISIBLE, away, np.nan))
        confidences.append(found[0, :, 2])
        area = np.array([np.prod(box[2:] - box[:2])], float)
        likeness.append(similarity(found.astype(float), truth[None].astype(float), area)[0, 0])
    return Placing(np.array(errors, float), np.array(confidences, float), np.array(likeness))


def milliseconds_per_person(model: Path, counts: Sequence[int] = (1, 5)) -> list[float]:
    """Median CPU time for frames with so many people of 500 pixels, cuts included."""
    network = _opened(model)
    noise = np.random.default_rng(0).integers(0, 255, (720, 1280, 3), dtype=np.uint8)
    result = []
    for count in counts:
        boxes = [(100.0 * place, 100.0, 100.0 * place + 200, 600.0) for place in range(count)]
        times = []
        for _ in range(_TIMED_RUNS):
            begin = time.process_time()
            network.find(noise, boxes)
            times.append(time.process_time() - begin)
        result.append(1000 * float(np.median(times)) / count)
    return result


def _opened(model: Path) -> KeypointModel:
    network = KeypointModel(model, threads=1)
    network.open()
    return network


def _box(
    box: NDArray[np.float32], rng: np.random.Generator | None
) -> tuple[float, float, float, float]:
    sides = (box[2:] - box[:2]).astype(float)
    middle = (box[:2] + box[2:]) / 2
    if rng is not None:
        middle = middle + rng.normal(0.0, _MOVED, 2) * sides
        sides = sides * np.exp(rng.normal(0.0, _SCALED, 2))
    left, top = (middle - sides / 2).tolist()
    right, bottom = (middle + sides / 2).tolist()
    return left, top, right, bottom
