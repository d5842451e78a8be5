"""KeypointModel: joints of people whose boxes are given."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from aerodaas.analytics.detection.model_file import read_model
from aerodaas.analytics.detection.providers import open_session
from aerodaas.analytics.models import POSE
from aerodaas.analytics.people.crop import cut_out, square_around
from aerodaas.analytics.people.joints import MIRRORED, POINTS
from aerodaas.types.errors import ModelError

__all__ = ["Box", "KeypointModel"]

Box = tuple[float, float, float, float]
"""Left, top, right, bottom in pixels."""

_TASK = "keypoints"
_NUMBERS = 3
"""Numbers per joint: u, v, confidence."""

_ASTRAY = 0.1
"""Distance of the two estimates of a joint, in sides of the crop, from which one is doubtful."""


class KeypointModel:
    """A keypoint network on square crops around people, as `tools.training pose` exports it.

    It maps crops (n, 3, s, s), RGB from 0 to 1, to keypoints (n, 17, 3): u and v in
    pixels of the crop, and the confidence, 0 to 1, that the joint is visible and correctly placed.

    The network runs on each crop twice, the second time mirrored. A real arm is found in both; a
    spurious one, such as a window behind a shoulder, rarely is.
    """

    def __init__(
        self,
        path: str | Path = POSE,
        *,
        providers: Sequence[str] | None = None,
        threads: int | None = None,
    ) -> None:
        """Read the file, which is sent to the actor by value; raises ModelError."""
        model = read_model(path)
        shape = model.output_shape
        if model.metadata.get("task") != _TASK or tuple(shape[1:]) != (POINTS, _NUMBERS):
            raise model.refusal(
                "finds no keypoints in cuts around people",
                "train one with `python -m tools.training pose`; a YOLO pose model is for "
                "OnnxDetector",
            )
        self.path = str(path)
        self.size = model.size[0]
        """Side of the crops in pixels."""
        self._content, self._input, self._dtype = model.content, model.input.name, model.dtype
        self._providers, self._threads = providers, threads
        self._session: ort.InferenceSession | None = None

    def open(self) -> None:
        """Create the session and warm it up, so that the mission's first frame is not slow."""
        self._session = open_session(self._content, self.path, self._providers, self._threads)
        self._run(np.zeros((1, 3, self.size, self.size), self._dtype))

    def close(self) -> None:
        """Release the session."""
        self._session = None

    def find(self, image: NDArray[np.uint8], boxes: Sequence[Box]) -> NDArray[np.float32]:
        """Find the keypoints (n, 17, 3) of the person in each of `boxes`, in pixels of `image`.

        `image` is BGR. All boxes take one run of the network; raises ModelError before `open`.
        """
        squares = [square_around(box) for box in boxes]
        cuts = np.stack([cut_out(image, square, self.size) for square in squares])
        both = np.concatenate([cuts, cuts[:, :, ::-1]])
        pixels = both[..., ::-1].transpose(0, 3, 1, 2).astype(self._dtype) / 255
        straight, mirrored = np.split(self._run(np.ascontiguousarray(pixels, self._dtype)), 2)
        found = self._agreed(straight, mirrored)
        for points, (left, top, side) in zip(found, squares, strict=True):
            points[:, :2] = points[:, :2] * (side / self.size) + (left, top)
        return found

    def _agreed(
        self, straight: NDArray[np.float32], mirrored: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Merge the keypoints of both runs; confidence falls with the distance between them."""
        other = mirrored[:, MIRRORED]
        other[..., 0] = self.size - other[..., 0]
        apart = np.linalg.norm(straight[..., :2] - other[..., :2], axis=-1) / self.size
        agreed = (straight + other) / 2
        surer = np.where(straight[..., 2:] >= other[..., 2:], straight, other)
        places = np.where((apart < _ASTRAY)[..., None], agreed, surer)
        places[..., 2] = agreed[..., 2] * np.exp(-0.5 * np.square(apart / _ASTRAY))
        return np.asarray(places, np.float32)

    def _run(self, pixels: NDArray[np.floating]) -> NDArray[np.float32]:
        if self._session is None:
            raise ModelError(f"{self.path}: call open() before the first frame")
        (found,) = self._session.run(None, {self._input: pixels})
        return np.array(found, np.float32)
