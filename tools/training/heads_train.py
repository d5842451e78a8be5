"""The training of the heads, on cached features of the frozen part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from tools.training.data_parallel import local_batch
from tools.training.features import Examples
from tools.training.heads import DetectorHeads
from tools.training.loop import Course, Progress, learn
from tools.training.loss import Targets, losses
from tools.training.yolox import SIZE

__all__ = ["HeadsRecipe", "train_heads"]


@dataclass(frozen=True)
class HeadsRecipe(Course):
    """What the heads' training depends on, beside the examples."""

    steps: int = 3000


def train_heads(examples: Examples, recipe: HeadsRecipe, folder: Path) -> Iterator[Progress]:
    """Train, or go on with it, in `folder`; yields as it goes."""
    torch.manual_seed(recipe.seed)

    def loss(
        step: int, rng: np.random.Generator, device: torch.device
    ) -> tuple[Tensor, tuple[float, ...]]:
        del step
        chosen = rng.choice(len(examples), local_batch(recipe.batch))
        features, targets = _batch_of(examples, chosen, device)
        with torch.autocast(device.type, torch.bfloat16):
            outputs = network(*features)
        parts = losses(outputs, targets, SIZE)
        return parts.total, parts.figures

    network = DetectorHeads()
    yield from learn(network, loss, recipe, folder)


def _batch_of(
    examples: Examples, chosen: NDArray[np.int64], device: torch.device
) -> tuple[list[Tensor], Targets]:
    """The chosen examples' features, and their labels, padded to the same number."""
    features = [
        torch.from_numpy(part).to(device).float().contiguous(memory_format=torch.channels_last)
        for part in examples.features(chosen)
    ]
    labels = [examples.labels(int(index)) for index in chosen]
    most = max(1, *(len(kinds) for kinds, _ in labels))
    kinds = np.zeros((len(labels), most), np.int64)
    boxes = np.zeros((len(labels), most, 4), np.float32)
    valid = np.zeros((len(labels), most), dtype=bool)
    for row, (some, around) in enumerate(labels):
        kinds[row, : len(some)], boxes[row, : len(some)] = some, around
        valid[row, : len(some)] = True
    arrays = (torch.from_numpy(array).to(device) for array in (kinds, boxes, valid))
    return features, Targets(*arrays)
