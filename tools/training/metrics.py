"""How good a detector is: average precision, and the best threshold, per class."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["SIGMAS", "Floats", "Ranking", "overlap", "similarity", "strays"]

Floats = NDArray[np.float64]

SIGMAS = np.array([26, 25, 25, 35, 35, 79, 79, 72, 72, 62, 62, 107, 107, 87, 87, 89, 89]) / 1000
"""How exactly people place each of COCO's keypoints, from COCO's keypoint evaluation."""


def overlap(one: Floats, other: Floats) -> Floats:
    """IoU (n, m) of boxes (n, 4) and (m, 4)."""
    low = np.maximum(one[:, None, :2], other[None, :, :2])
    high = np.minimum(one[:, None, 2:], other[None, :, 2:])
    inner = np.clip(high - low, 0, None).prod(axis=-1)
    areas = [np.prod(boxes[:, 2:] - boxes[:, :2], axis=-1) for boxes in (one, other)]
    return np.asarray(inner / (areas[0][:, None] + areas[1][None] - inner + 1e-9))


def similarity(found: Floats, truth: Floats, areas: Floats) -> Floats:
    """COCO's object keypoint similarity (n, m) of (n, 17, 3) and (m, 17, 3) of boxes' `areas`."""
    away = np.square(found[:, None, :, :2] - truth[None, :, :, :2]).sum(axis=-1)
    # COCO measures by the outline's area, about half of the box's.
    scale = 2 * np.square(2 * SIGMAS) * (0.53 * areas[None, :, None] + 1e-9)
    inside = truth[None, :, :, 2] > 0
    like = np.where(inside, np.exp(-away / scale), 0.0).sum(axis=-1)
    return np.asarray(like / np.maximum(inside.sum(axis=-1), 1))


def strays(boxes: Floats, things: Floats) -> NDArray[np.bool_]:
    """Which of `boxes` (n, 4) have their middle on none of `things` (m, 4)."""
    middle = (boxes[:, None, :2] + boxes[:, None, 2:]) / 2
    low, high = things[None, :, :2], things[None, :, 2:]
    on = np.asarray((middle >= low) & (middle <= high), dtype=bool)
    return ~np.any(np.all(on, axis=-1), axis=1)


@dataclass
class Ranking:
    """All detections of one class over many pictures, and how many things there were."""

    scores: list[float]
    hits: list[bool]
    things: int = 0

    @classmethod
    def empty(cls) -> Ranking:
        """Nothing yet."""
        return cls([], [])

    def add(
        self, scores: Floats, table: Floats, counts: NDArray[np.bool_], least: float = 0.5
    ) -> None:
        """Count one picture: a detection hits if it is like a thing not yet taken.

        `table` (detections, things) tells how alike they are, 0 to 1; `least` is enough. Things
        that do not `counts` (things,) need not be found, and may be.
        """
        things = table.shape[1]
        self.things += int(counts.sum())
        free = np.ones(things, dtype=bool)
        for row in np.argsort(-scores):
            fit = np.where(free, table[row], 0.0)
            hit = bool(things) and float(fit.max()) >= least
            if hit:
                free[int(fit.argmax())] = False
                if not counts[int(fit.argmax())]:
                    continue
            self.scores.append(float(scores[row]))
            self.hits.append(hit)

    def _curve(self) -> tuple[Floats, Floats, Floats]:
        order = np.argsort(-np.array(self.scores), kind="stable")
        hits = np.cumsum(np.array(self.hits, dtype=float)[order])
        recall = hits / max(1, self.things)
        precision = hits / np.arange(1, len(order) + 1)
        return recall, precision, np.array(self.scores)[order]

    @property
    def average_precision(self) -> float:
        """Area below precision over recall, sampled at 101 recalls as COCO does."""
        if not self.scores:
            return 0.0
        recall, precision, _ = self._curve()
        envelope = np.maximum.accumulate(precision[::-1])[::-1]
        places = np.searchsorted(recall, np.linspace(0, 1, 101))
        padded = np.append(envelope, 0.0)
        return float(padded[np.minimum(places, len(envelope))].mean())
