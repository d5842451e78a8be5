"""The detector's training: pictures of two sizes, and what is lost on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from tools.training.augment import augmented
from tools.training.data_parallel import local_batch
from tools.training.dataset import Pictures, Sample
from tools.training.loop import Course, Progress, learn
from tools.training.loss import Targets, losses
from tools.training.network import DetectorNetwork

__all__ = ["Recipe", "train"]

_MOSAICS, _WHOLE = 0.2, 0.2
"""Share of pictures that are patched together of four, and of the steps, the last ones, that get
none (as YOLOX: Ge et al., 2021)."""


@dataclass(frozen=True)
class Recipe(Course):
    """What the detector's training depends on, beside the pictures."""

    steps: int = 7600
    halved: int = 4400
    """Of these, the first ones, on pictures of half the size: a fourth of the work."""
    size: tuple[int, int] = (192, 320)
    """Height and width to train at, multiples of 64: most pictures leave no more of the square."""


def train(pictures: Pictures, recipe: Recipe, folder: Path) -> Iterator[Progress]:
    """Train, or go on with it, in `folder`; yields as it goes."""
    torch.manual_seed(recipe.seed)
    network = DetectorNetwork()

    def loss(
        step: int, rng: np.random.Generator, device: torch.device
    ) -> tuple[Tensor, tuple[float, ...]]:
        size, draw = _source(pictures, recipe, step, rng)
        mosaics = _MOSAICS if step < (1 - _WHOLE) * recipe.steps else 0.0
        samples = [augmented(draw, size, rng, mosaics) for _ in range(local_batch(recipe.batch))]
        inputs, targets = _batch_of(samples, device)
        with torch.autocast(device.type, torch.bfloat16):
            outputs = network(inputs)
        parts = losses(outputs, targets, size)
        return parts.total, parts.figures

    yield from learn(network, loss, recipe, folder)


def _source(
    pictures: Pictures, recipe: Recipe, step: int, rng: np.random.Generator
) -> tuple[tuple[int, int], Callable[[], Sample]]:
    """Size to train at, and what draws a picture for it."""
    height, width = recipe.size
    if step < recipe.halved:
        return (height // 2, width // 2), lambda: pictures.halved(int(rng.integers(len(pictures))))
    return (height, width), lambda: pictures[int(rng.integers(len(pictures)))]


def _batch_of(samples: list[Sample], device: torch.device) -> tuple[Tensor, Targets]:
    """Stack samples of one size into the network's input (RGB, 0 to 1) and padded labels."""
    images = np.stack([sample.image for sample in samples])[..., ::-1]
    pixels = torch.from_numpy(np.ascontiguousarray(images)).to(device).permute(0, 3, 1, 2)
    most = max(1, *(len(sample.kinds) for sample in samples))
    kinds = np.zeros((len(samples), most), np.int64)
    boxes = np.zeros((len(samples), most, 4), np.float32)
    valid = np.zeros((len(samples), most), dtype=bool)
    for row, sample in enumerate(samples):
        count = len(sample.kinds)
        kinds[row, :count], boxes[row, :count] = sample.kinds, sample.boxes
        valid[row, :count] = True
    arrays = (torch.from_numpy(array).to(device) for array in (kinds, boxes, valid))
    inputs = pixels.contiguous(memory_format=torch.channels_last).float() / 255
    return inputs, Targets(*arrays)
