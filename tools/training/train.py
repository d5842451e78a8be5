"""The detector's training: what is drawn for each step, and what is lost on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

from tools.training.augment import augmented
from tools.training.data_parallel import local_batch, rank
from tools.training.dataset import Pictures, Sample
from tools.training.loop import Course, Progress, learn
from tools.training.loss import Targets, losses
from tools.training.network import DetectorNetwork
from tools.training.restart import learn_on_from
from tools.training.yolox import FrozenYolox

__all__ = ["Recipe", "feed", "train"]

_MOSAICS, _WHOLE = 0.2, 0.2
"""Share of pictures that are patched together of four, and of the steps, the last ones, that get
none (as YOLOX: Ge et al., 2021)."""

_Batch = tuple[Tensor, Tensor, Tensor, Tensor]
"""Pictures (b, rows, columns, 3) of bytes, BGR; kinds, boxes and validity of `Targets`."""


@dataclass(frozen=True)
class Recipe(Course):
    """What the detector's training depends on, beside the pictures."""

    steps: int = 8000
    batch: int = 96
    memory: float = 0.9995
    size: tuple[int, int] = (256, 384)
    """Height and width to train at, multiples of 32."""
    loaders: int = 0
    """Processes that draw pictures ahead; with none, each is drawn when its step comes."""
    kept: float = 0.0
    """Share, in the detector that is exported, of the one that training started from."""


def train(
    pictures: Pictures, frozen: FrozenYolox, recipe: Recipe, folder: Path
) -> Iterator[Progress]:
    """Train, or go on with it, in `folder`; yields as it goes."""
    torch.manual_seed(recipe.seed)
    batches: Iterator[_Batch] | None = None

    def loss(
        step: int, rng: np.random.Generator, device: torch.device
    ) -> tuple[Tensor, tuple[float, ...]]:
        nonlocal batches
        del rng
        if batches is None:
            frozen.to(device)
            batches = iter(feed(pictures, recipe, step))
        images, *labels = (part.to(device, non_blocking=True) for part in next(batches))
        pixels = images.permute(0, 3, 1, 2).flip(1).float() / 255
        with torch.autocast(device.type, torch.bfloat16):
            with torch.no_grad():
                features = frozen.features(pixels.contiguous(memory_format=torch.channels_last))
            outputs = network(features)
        parts = losses(outputs, Targets(*labels), recipe.size)
        return parts.total, parts.figures

    network = DetectorNetwork()
    if recipe.start is not None and recipe.start.suffix == ".onnx":
        images = next(iter(feed(pictures, replace(recipe, loaders=0), 0)))[0]
        pixels = images.permute(0, 3, 1, 2).flip(1).float() / 255
        with torch.no_grad():
            learn_on_from(recipe.start, network, frozen.features(pixels))
        recipe = replace(recipe, start=None)
    yield from learn(network, loss, recipe, folder)


class _Batches(IterableDataset[_Batch]):
    """The batches of each step from `first` on, drawn by its number, whoever draws it."""

    def __init__(self, pictures: Pictures, recipe: Recipe, first: int) -> None:
        self._pictures, self._recipe, self._first = pictures, recipe, first
        self._rank, self._count = rank(), local_batch(recipe.batch)

    def __iter__(self) -> Iterator[_Batch]:
        worker = get_worker_info()
        start, apart = (0, 1) if worker is None else (worker.id, worker.num_workers)
        for step in range(self._first + start, self._recipe.steps, apart):
            yield self._drawn(step)

    def _drawn(self, step: int) -> _Batch:
        recipe, pictures = self._recipe, self._pictures
        rng = np.random.default_rng([recipe.seed, step, self._rank])
        mosaics = _MOSAICS if step < (1 - _WHOLE) * recipe.steps else 0.0

        def draw() -> Sample:
            return pictures[int(rng.integers(len(pictures)))]

        return _stacked([augmented(draw, recipe.size, rng, mosaics) for _ in range(self._count)])


def feed(pictures: Pictures, recipe: Recipe, first: int) -> DataLoader[_Batch]:
    """Draw the batches of the steps from `first` on, by `recipe.loaders` processes."""
    return DataLoader(
        _Batches(pictures, recipe, first),
        batch_size=None,
        num_workers=recipe.loaders,
        prefetch_factor=4 if recipe.loaders else None,
        pin_memory=torch.cuda.is_available(),
    )


def _stacked(samples: list[Sample]) -> _Batch:
    """Stack samples of one size, and their labels, padded to the same number."""
    most = max(1, *(len(sample.kinds) for sample in samples))
    kinds = np.zeros((len(samples), most), np.int64)
    boxes = np.zeros((len(samples), most, 4), np.float32)
    valid = np.zeros((len(samples), most), dtype=bool)
    for row, sample in enumerate(samples):
        count = len(sample.kinds)
        kinds[row, :count], boxes[row, :count] = sample.kinds, sample.boxes
        valid[row, :count] = True
    images = torch.from_numpy(np.stack([sample.image for sample in samples]))
    return images, torch.from_numpy(kinds), torch.from_numpy(boxes), torch.from_numpy(valid)
