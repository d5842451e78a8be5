"""Array arithmetic shared by several families."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["best_class", "corners"]


def corners(centred: NDArray[np.float32]) -> NDArray[np.float32]:
    """Convert N x 4 boxes of centre u, v, width, height to left, top, right, bottom."""
    half = centred[:, 2:4] / 2
    boxes = np.hstack([centred[:, :2] - half, centred[:, :2] + half])
    return boxes.astype(np.float32, copy=False)


def best_class(
    scores: NDArray[np.float32], min_score: float
) -> tuple[NDArray[np.intp], NDArray[np.float32], NDArray[np.int32], int]:
    """Find the best class of each anchor in C x N `scores`.

    Returns the anchors that reach `min_score`, their scores and classes, and the number of
    anchors with a NaN score. The class is computed only for the few anchors kept.
    """
    best = scores.max(axis=0)
    kept = np.flatnonzero(best >= min_score)
    invalid = int(np.count_nonzero(np.isnan(best)))
    return kept, best[kept], scores[:, kept].argmax(axis=0).astype(np.int32), invalid
