"""Labelled pictures on disk: shards of JPEG files and arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.people.joints import POINTS
from tools.training.labelling import Label

__all__ = ["Pictures", "Sample", "save_shard"]

_QUALITY = 95


@dataclass(frozen=True)
class Sample:
    """One labelled picture."""

    image: NDArray[np.uint8]
    """(height, width, 3), BGR."""
    kinds: NDArray[np.int64]
    """(n,) indices in DETECTOR_CLASSES."""
    boxes: NDArray[np.float32]
    """(n, 4): left, top, right, bottom in pixels."""
    keypoints: NDArray[np.float32]
    """(n, 17, 3): u, v and visibility; 0 throughout for what is no person."""

    @classmethod
    def of(cls, image: NDArray[np.uint8], labels: list[Label], scale: float = 1.0) -> Sample:
        """Gather labels, their pixels multiplied by `scale`."""
        kinds = np.array([label.kind for label in labels], np.int64)
        boxes = np.array([label.box for label in labels], np.float32).reshape(-1, 4) * scale
        keypoints = np.zeros((len(labels), POINTS, 3), np.float32)
        for row, label in zip(keypoints, labels, strict=True):
            if label.keypoints is not None:
                row[:] = label.keypoints * (scale, scale, 1.0)
        return cls(image, kinds, boxes.astype(np.float32), keypoints)


def save_shard(path: Path, samples: list[Sample]) -> None:
    """Write samples as one .npz file."""
    files = [
        cv2.imencode(".jpg", sample.image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
        for sample in samples
    ]
    counts = np.array([len(sample.kinds) for sample in samples])
    np.savez(
        path,
        files=np.concatenate(files),
        sizes=np.array([len(file) for file in files]),
        counts=counts,
        kinds=np.concatenate([sample.kinds for sample in samples]),
        boxes=np.concatenate([sample.boxes for sample in samples]),
        keypoints=np.concatenate([sample.keypoints for sample in samples]),
    )


class Pictures:
    """All samples of a folder's shards, held in memory as JPEG."""

    def __init__(self, folder: Path) -> None:
        """Read the shards; raises FileNotFoundError if there are none."""
        self._files: list[NDArray[np.uint8]] = []
        self._labels: list[tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]]] = []
        shards = sorted(path for path in folder.glob("*.npz") if path.stem.isdigit())
        if not shards:
            raise FileNotFoundError(
                f"no pictures in {folder}; render some with `python -m tools.training render`"
            )
        for shard in shards:
            with np.load(shard) as arrays:
                ends = np.cumsum(arrays["sizes"])[:-1]
                self._files += np.split(arrays["files"], ends)
                rows = np.cumsum(arrays["counts"])[:-1]
                self._labels += zip(
                    np.split(arrays["kinds"], rows),
                    np.split(arrays["boxes"], rows),
                    np.split(arrays["keypoints"], rows),
                    strict=True,
                )

    def __len__(self) -> int:
        """Count the samples."""
        return len(self._files)

    def __getitem__(self, index: int) -> Sample:
        """Decode one."""
        image = cv2.imdecode(self._files[index], cv2.IMREAD_COLOR)
        return Sample(np.asarray(image, np.uint8), *self._labels[index])
