"""Array arithmetic shared by several families."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["best_class", "corners", "listed"]


def corners(centred: NDArray[np.float32]) -> NDArray[np.float32]:
    """Convert N x 4 boxes of centre u, v, width, height to left, top, right, bottom."""
    half = centred[:, 2:4] / 2
    boxes = np.hstack([centred[:, :2] - half, centred[:, :2] + half])
    return boxes.astype(np.float32, copy=False)


def best_class(
    scores: NDArray[np.float32], min_score: float
) -> tuple[NDArray[np.intp], NDArray[np.float32], NDArray[np.int32], int]:
    """Find the best class of each anchor.

    The class is computed only for the few anchors kept.

    Args:
        scores: Scores, C classes x N anchors.
        min_score: Least score of an anchor that is kept.

    Returns:
        Anchors that are kept, their scores and classes, and the number of anchors with a NaN score.
    """
    best = scores.max(axis=0)
    kept = np.flatnonzero(best >= min_score)
    invalid = int(np.count_nonzero(np.isnan(best)))
    return kept, best[kept], scores[:, kept].argmax(axis=0).astype(np.int32), invalid


def listed(
    scores: NDArray[np.float32], classes: NDArray[np.float32], count: int, min_score: float
) -> tuple[NDArray[np.intp], NDArray[np.float32], NDArray[np.int32], int]:
    """Find the detections of a list that have a score and a class.

    Args:
        scores: Score of each row.
        classes: Number of each row's class.
        count: Number of classes.
        min_score: Least score of a row that is kept.

    Returns:
        Rows that are kept, their scores and classes, and the number of rows with a NaN score, or of
        no class though they reach `min_score`.
    """
    enough = scores >= min_score
    known = (classes >= 0) & (classes < count)
    kept = np.flatnonzero(enough & known)
    invalid = int(np.count_nonzero(np.isnan(scores) | (enough & ~known)))
    return kept, scores[kept], classes[kept].astype(np.int32), invalid
