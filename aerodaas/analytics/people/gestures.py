"""Gesture classification from keypoints.

Keypoints are normalised, then a support vector machine classifies the body as fallen, with a
raised hand, upright or other.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from aerodaas.analytics.people.joints import HIPS, POINTS, SHOULDERS, visible
from aerodaas.errors import ModelError

__all__ = ["GESTURES", "GESTURE_MODEL", "GestureClassifier", "normalised"]

GESTURES = ("fallen", "hand_raised", "other", "upright")
"""Classes of the model; `upright` is standing or walking, `other` sitting, bending and the like."""

GESTURE_MODEL = Path(__file__).parents[1] / "models" / "gestures.onnx"
"""The shipped model; `gestures.md` beside it describes its training and accuracy."""

_LEAST = 5
"""Least number of keypoints for a classification."""
_FARTHEST = 4.0

Array = NDArray[np.float32]


def normalised(keypoints: Array, min_confidence: float) -> tuple[Array, NDArray[np.bool_]]:
    """Features of bodies, independent of their place and distance.

    A body is centred on its trunk and scaled to one size. Missing points are placed at the centre,
    and 17 further features flag the points present.

    Args:
        keypoints: Keypoints of N bodies, (N, 17, 3): u, v, confidence.
        min_confidence: Confidence below which keypoints count as missing, as do those not finite.

    Returns:
        Features (N, 51), and a mask of the usable bodies, which have at least five points, one of
        them of the trunk.
    """
    points = np.asarray(keypoints[..., :2], np.float64)
    seen = visible(keypoints, min_confidence)
    points = np.where(seen[..., None], np.nan_to_num(points), 0.0)
    trunk = np.zeros_like(seen)
    trunk[:, SHOULDERS], trunk[:, HIPS] = seen[:, SHOULDERS], seen[:, HIPS]
    useful = (seen.sum(axis=1) >= _LEAST) & trunk.any(axis=1)
    middle = _mean(points, trunk)
    offsets = np.where(seen[..., None], points - middle[:, None], 0.0)
    spread = np.sqrt((offsets**2).sum(axis=(1, 2)) / np.maximum(seen.sum(axis=1), 1))
    useful &= spread > 0
    flat = offsets / np.where(spread > 0, spread, 1.0)[:, None, None]
    flat = np.clip(flat, -_FARTHEST, _FARTHEST).reshape(len(points), -1)
    return np.hstack([flat, seen.astype(np.float64)]).astype(np.float32), useful


def _mean(points: NDArray[np.float64], seen: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Mean of the visible trunk points, with equal weights for shoulders and hips."""
    groups = []
    for part in (SHOULDERS, HIPS):
        count = seen[:, part].sum(axis=1)
        groups.append(
            (points[:, part] * seen[:, part, None]).sum(axis=1) / np.maximum(count, 1)[:, None]
        )
    there = np.stack([seen[:, part].any(axis=1) for part in (SHOULDERS, HIPS)])
    total = there[0][:, None] * groups[0] + there[1][:, None] * groups[1]
    return np.asarray(total / np.maximum(there.sum(axis=0), 1)[:, None])


class GestureClassifier:
    """Gesture classifier in an ONNX file, with a probability for each of `GESTURES`."""

    def __init__(self, path: str | Path = GESTURE_MODEL, *, min_confidence: float = 0.35) -> None:
        """Read the model, which is copied to where it runs; raises ModelError.

        Keypoints below `min_confidence` (0 to 1) count as missing.
        """
        if not 0.0 <= min_confidence <= 1.0:
            raise ModelError(f"min_confidence must lie between 0 and 1, not {min_confidence}")
        self.path = str(path)
        self.min_confidence = min_confidence
        try:
            self._content = Path(path).read_bytes()
        except OSError as error:
            raise ModelError(f"cannot read the gesture model {path}: {error.strerror}") from None
        self._session: ort.InferenceSession | None = None
        self.open()
        self.close()

    def open(self) -> None:
        """Load the model; raises ModelError if it is not a gesture model."""
        options = ort.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            session = ort.InferenceSession(
                self._content, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # noqa: BLE001 - onnxruntime's errors have no common base
            raise ModelError(f"{self.path} is no ONNX model: {error}") from None
        shapes = [tuple(port.shape[1:]) for port in (*session.get_inputs(), *session.get_outputs())]
        if shapes != [(3 * POINTS,), (len(GESTURES),)]:
            raise ModelError(
                f"{self.path} is no gesture model: it takes and gives {shapes}; train one with "
                "`python -m tools.training gestures`"
            )
        self._session = session

    def close(self) -> None:
        """Release the model."""
        self._session = None

    def classify(self, keypoints: Sequence[Array]) -> list[tuple[str, float] | None]:
        """Gesture and probability of each body (17 x 3); None for an unusable body."""
        if self._session is None:
            raise ModelError(f"{self.path}: call open() before the first frame")
        if not keypoints:
            return []
        features, useful = normalised(np.stack(keypoints).astype(np.float32), self.min_confidence)
        (scores,) = self._session.run(None, {self._session.get_inputs()[0].name: features})
        return [
            (GESTURES[int(row.argmax())], float(row.max())) if told else None
            for row, told in zip(np.asarray(scores), useful, strict=True)
        ]
