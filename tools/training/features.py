"""The cache of what the frozen part makes of augmented renders: training reads it many times."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tools.training.augment import augmented
from tools.training.dataset import Pictures
from tools.training.yolox import FEATURES, SIZE, FeatureExtractor

__all__ = ["Examples", "cache_features"]

_PER_SHARD = 400
_MOSAICS = 0.15
"""Share of examples patched together of four pictures."""

_SHAPES = [(width, SIZE[0] // stride, SIZE[1] // stride) for width, stride in FEATURES.values()]
_ENDS = np.cumsum([np.prod(shape) for shape in _SHAPES]).tolist()


def cache_features(
    pictures: Pictures, extract: FeatureExtractor, folder: Path, count: int, seed: int = 1
) -> Iterator[int]:
    """Write `count` examples into `folder`; yields how many there are. Resumes."""
    folder.mkdir(parents=True, exist_ok=True)
    for first in range(0, count, _PER_SHARD):
        path = folder / f"{first:08d}.npy"
        number = min(_PER_SHARD, count - first)
        if not path.exists():
            _write_shard(pictures, extract, path, number, np.random.default_rng([seed, first]))
        yield first + number


def _write_shard(
    pictures: Pictures,
    extract: FeatureExtractor,
    path: Path,
    number: int,
    rng: np.random.Generator,
) -> None:
    order = _endless(len(pictures), rng)
    partial = path.with_suffix(".partial")
    values = np.lib.format.open_memmap(partial, "w+", np.float16, (number, _ENDS[-1]))
    labels = []
    for row in values:
        sample = augmented(lambda: pictures[next(order)], SIZE, rng, _MOSAICS)
        row[:] = np.concatenate([m.ravel() for m in extract(sample.image)])
        labels.append((sample.kinds, sample.boxes))
    values.flush()
    np.savez(
        path.with_suffix(".npz"),
        counts=np.array([len(kinds) for kinds, _ in labels]),
        kinds=np.concatenate([kinds for kinds, _ in labels]),
        boxes=np.concatenate([boxes for _, boxes in labels]),
    )
    partial.rename(path)


def _endless(count: int, rng: np.random.Generator) -> Iterator[int]:
    """Numbers below `count` in random order, again and again."""
    while True:
        yield from rng.permutation(count).tolist()


class Examples:
    """The cached examples of a folder; features stay on disk until they are asked for."""

    def __init__(self, folder: Path) -> None:
        """Open the shards; raises FileNotFoundError if there are none."""
        self._rows: list[NDArray[np.float16]] = []
        self._labels: list[tuple[NDArray[np.int64], NDArray[np.float32]]] = []
        for path in sorted(folder.glob("*.npy")):
            self._rows += list(np.load(path, mmap_mode="r"))
            with np.load(path.with_suffix(".npz")) as arrays:
                cuts = np.cumsum(arrays["counts"])[:-1]
                kinds, boxes = np.split(arrays["kinds"], cuts), np.split(arrays["boxes"], cuts)
                self._labels += zip(kinds, boxes, strict=True)
        if not self._rows:
            raise FileNotFoundError(f"no features in {folder}")

    def __len__(self) -> int:
        """Count the examples."""
        return len(self._rows)

    def features(self, indices: NDArray[np.int64]) -> list[NDArray[np.float16]]:
        """Features (n, channels, rows, columns) of the examples, in the order of FEATURES."""
        rows = np.stack([self._rows[index] for index in indices])
        parts = np.split(rows, _ENDS[:-1], axis=1)
        return [part.reshape(-1, *shape) for part, shape in zip(parts, _SHAPES, strict=True)]

    def labels(self, index: int) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Kinds (n,) and boxes (n, 4) of an example."""
        return self._labels[index]
