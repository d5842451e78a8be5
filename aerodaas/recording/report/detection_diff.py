"""Comparison of two detectors' results by overlapping boxes."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from aerodaas.geometry.frames import Box
from aerodaas.messages.detections import Detection

__all__ = ["DetectionDiff", "box_shift"]

_OVERLAP = 0.5
"""Least intersection over union of two boxes of the same object, as in PASCAL VOC."""


@dataclass(frozen=True, slots=True)
class DetectionDiff:
    """Comparison of two results for the same frames, boxes paired by label and overlap."""

    paired: int
    lost: int
    """Number of objects that only the first result has."""
    new: int
    """Number of objects that only the second result has."""
    median_pixels: float
    """Median over the pairs of the largest distance between edges."""
    most_pixels: float
    most_score: float
    """Largest difference of a pair's scores."""

    def __str__(self) -> str:
        """One readable line."""
        text = f"{self.paired} objects found again, {self.lost} lost, {self.new} new"
        if not self.paired:
            return text
        return (
            f"{text}; boxes moved by {self.median_pixels:.1f} pixels (median, at most "
            f"{self.most_pixels:.1f}), scores by at most {self.most_score:.2f}"
        )


def box_shift(results: Iterable[tuple[Sequence[Detection], Sequence[Detection]]]) -> DetectionDiff:
    """Pair the objects of each frame's two results and measure their differences.

    Args:
        results: For each frame, both results.
    """
    moves, scores = [], []
    lost = new = 0
    for first, second in results:
        left = list(second)
        for item in first:
            match = max(left, key=lambda other: _likeness(item, other), default=None)
            if match is None or _likeness(item, match) < _OVERLAP:
                lost += 1
                continue
            left.remove(match)
            pairs = zip(item.box, match.box, strict=True)
            moves.append(max(abs(a - b) for a, b in pairs))
            scores.append(abs(item.score - match.score))
        new += len(left)
    return DetectionDiff(
        len(moves),
        lost,
        new,
        statistics.median(moves) if moves else 0.0,
        max(moves, default=0.0),
        max(scores, default=0.0),
    )


def _likeness(one: Detection, other: Detection) -> float:
    """Intersection over union; -1 for different labels."""
    return _overlap(one.box, other.box) if one.label == other.label else -1.0


def _overlap(one: Box, other: Box) -> float:
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    common = max(0.0, width) * max(0.0, height)
    whole = _area(one) + _area(other) - common
    return common / whole if whole > 0 else 0.0


def _area(box: Box) -> float:
    return max(0.0, box[2] - box[0]) * max(0.0, box[3] - box[1])
