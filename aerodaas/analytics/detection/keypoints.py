"""KeypointModel: joints of people whose boxes are given."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from aerodaas.analytics.detection.keypoint_heads import keypoint_head
from aerodaas.analytics.detection.model_file import read_model
from aerodaas.analytics.detection.providers import open_session
from aerodaas.analytics.models import POSE
from aerodaas.analytics.people.crop import cut_region
from aerodaas.analytics.people.joints import MIRRORED
from aerodaas.errors import ModelError
from aerodaas.geometry.frames import Box

__all__ = ["KeypointModel"]

_ASTRAY = 0.1
"""Distance of the two estimates of a joint, in sides of the crop, from which one is doubtful."""


class KeypointModel:
    """A keypoint network on crops around people: as `tools.training pose` exports it, or RTMPose.

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
        """Read the file, or a fetched model by its name; it is copied to where it runs.

        Raises:
            ModelError: If it is missing, or is no such network.
            UnknownIdError: If no model has this name.
        """
        model = read_model(path)
        head = keypoint_head(model)
        if head is None:
            raise model.refusal(
                "finds no keypoints in cuts around people",
                "train one with `python -m tools.training pose`, or take an RTMPose; a YOLO pose "
                "model is for OnnxDetector",
            )
        self.path = str(path)
        self.head = head
        """How the network crops, normalises and gives its joints."""
        self._content, self._input, self._dtype = model.content, model.input.name, model.dtype
        self._providers, self._threads = providers, threads
        self._session: ort.InferenceSession | None = None

    def open(self) -> None:
        """Create the session and warm it up, so that the mission's first frame is not slow."""
        self._session = open_session(self._content, self.path, self._providers, self._threads)
        width, height = self.head.size
        self._run(np.zeros((1, height, width, 3), np.uint8))

    def close(self) -> None:
        """Release the session."""
        self._session = None

    def find(self, image: NDArray[np.uint8], boxes: Sequence[Box]) -> NDArray[np.float32]:
        """Find the keypoints (n, 17, 3) of the person in each of `boxes`, in pixels of `image`.

        `image` is BGR. All boxes take one run of the network; raises ModelError before `open`.
        """
        head = self.head
        regions = [head.region(box) for box in boxes]
        cuts = np.stack([cut_region(image, one, head.size, head.fill) for one in regions])
        straight, mirrored = np.split(self._run(np.concatenate([cuts, cuts[:, :, ::-1]])), 2)
        found = self._agreed(straight, mirrored)
        for points, (left, top, wide, _) in zip(found, regions, strict=True):
            points[:, :2] = points[:, :2] * (wide / head.size[0]) + (left, top)
        return found

    def _agreed(
        self, straight: NDArray[np.float32], mirrored: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Merge the keypoints of both runs; confidence falls with the distance between them."""
        other = mirrored[:, MIRRORED]
        other[..., 0] = self.head.size[0] - other[..., 0]
        away = np.linalg.norm(straight[..., :2] - other[..., :2], axis=-1)
        apart = away / max(self.head.size)
        agreed = (straight + other) / 2
        surer = np.where(straight[..., 2:] >= other[..., 2:], straight, other)
        places = np.where((apart < _ASTRAY)[..., None], agreed, surer)
        places[..., 2] = agreed[..., 2] * np.exp(-0.5 * np.square(apart / _ASTRAY))
        return np.asarray(places, np.float32)

    def _run(self, cuts: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Keypoints in crops (n, height, width, 3), BGR."""
        if self._session is None:
            raise ModelError(f"{self.path}: call open() before the first frame")
        pixels = self.head.normalise(cuts[..., ::-1]).transpose(0, 3, 1, 2)
        given = np.ascontiguousarray(pixels, self._dtype)
        outputs = self._session.run(None, {self._input: given})
        return self.head.decode([np.asarray(output) for output in outputs])
