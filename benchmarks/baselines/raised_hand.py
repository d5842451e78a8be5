"""Whether a person raises a hand, by the shipped keypoint network and ONNX Runtime."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from box_detector import Box, session
from numpy.typing import NDArray

SIDE, MARGIN, SURE = 128, 1.5, 0.35
FACE, ARMS = slice(0, 5), ((5, 7, 9), (6, 8, 10))


class RaisedHand:
    """The network, with what goes before and after it."""

    def __init__(self) -> None:
        self.network = session("pose.onnx")

    def shows(self, image: NDArray[Any], person: Box) -> bool:
        """Whether a wrist is above the face, in an RGB picture."""
        side = MARGIN * max(person.right - person.left, person.bottom - person.top)
        scale = SIDE / side
        moved = np.array([[scale, 0, 0], [0, scale, 0]])
        moved[:, 2] = [scale * (side / 2 - person.u), scale * (side / 2 - person.v)]
        cut = cv2.warpAffine(image, moved, (SIDE, SIDE), borderValue=(114, 114, 114))
        pixels = cut.transpose(2, 0, 1)[None].astype(np.float32) / 255
        (joints,) = self.network.run(None, {"cuts": pixels})[0]
        face = joints[FACE][joints[FACE, 2] >= SURE]
        return len(face) > 0 and any(
            bool((joints[list(arm), 2] >= SURE).all() and joints[arm[2], 1] < face[:, 1].min())
            for arm in ARMS
        )
