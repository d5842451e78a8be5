"""The training loop of the detector, and what other loops share with it."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor, nn

from aerodaas.training.augment import augmented
from aerodaas.training.dataset import Pictures, Sample
from aerodaas.training.labelling import KEYPOINTS
from aerodaas.training.loss import Targets, losses
from aerodaas.training.network import Eyes

__all__ = [
    "Progress",
    "Recipe",
    "batch_of",
    "follow",
    "keep",
    "optimiser_of",
    "resume",
    "schedule",
    "train",
]

_WARM_UP = 150
"""Steps over which the rate of learning rises."""

_MEMORY = 0.9985
"""Of the running mean of weights, per step."""

_KEEP_EVERY = 250


@dataclass(frozen=True)
class Recipe:
    """All that a training depends on, beside the pictures."""

    steps: int = 7600
    halved: int = 4400
    """Of these, the first ones, on pictures of half the size: a fourth of the work."""
    batch: int = 32
    rate: float = 2e-3
    decay: float = 0.03
    size: tuple[int, int] = (192, 320)
    """Height and width to train at, multiples of 64: most pictures leave no more of the square."""
    seed: int = 1
    start: Path | None = None
    """Weights to begin with, instead of random ones."""


@dataclass(frozen=True)
class Progress:
    """How far it got, and the parts of the loss, averaged over the last steps."""

    step: int
    parts: tuple[float, ...]
    seconds: float
    """Since the very beginning."""


def batch_of(samples: list[Sample], device: torch.device) -> tuple[Tensor, Targets]:
    """Stack samples of one size into the network's input (RGB, 0 to 1) and padded labels."""
    images = np.stack([sample.image for sample in samples])[..., ::-1]
    pixels = torch.from_numpy(np.ascontiguousarray(images)).to(device).permute(0, 3, 1, 2)
    most = max(1, *(len(sample.kinds) for sample in samples))
    kinds = np.zeros((len(samples), most), np.int64)
    boxes = np.zeros((len(samples), most, 4), np.float32)
    keypoints = np.zeros((len(samples), most, KEYPOINTS, 3), np.float32)
    valid = np.zeros((len(samples), most), dtype=bool)
    for row, sample in enumerate(samples):
        count = len(sample.kinds)
        kinds[row, :count], boxes[row, :count] = sample.kinds, sample.boxes
        keypoints[row, :count], valid[row, :count] = sample.keypoints, True
    arrays = (torch.from_numpy(array).to(device) for array in (kinds, boxes, keypoints, valid))
    inputs = pixels.contiguous(memory_format=torch.channels_last).float() / 255
    return inputs, Targets(*arrays)


def train(pictures: Pictures, recipe: Recipe, folder: Path) -> Iterator[Progress]:
    """Train from where `folder` has a checkpoint, or from the start; yields as it goes.

    The mean of the weights is kept in `folder/weights.pt`, everything else beside it, so that a
    training that was stopped goes on. Runs on a GPU if there is one.
    """
    torch.manual_seed(recipe.seed)
    cv2.setNumThreads(0)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network = Eyes().to(device=device, memory_format=torch.channels_last)
    if recipe.start is not None:
        network.load_state_dict(torch.load(recipe.start, weights_only=True, map_location=device))
    mean = copy.deepcopy(network).eval()
    optimiser = optimiser_of(network, recipe.rate, recipe.decay)
    step, before = resume(folder, network, mean, optimiser)
    begun = time.monotonic()
    rng = np.random.default_rng([recipe.seed, step])
    sums: list[tuple[float, ...]] = []
    while step < recipe.steps:
        network.train()
        for group in optimiser.param_groups:
            group["lr"] = recipe.rate * schedule(step, recipe.steps)
        size, draw = _source(pictures, recipe, step, rng)
        samples = [augmented(draw, size, rng) for _ in range(recipe.batch)]
        inputs, targets = batch_of(samples, device)
        with torch.autocast(device.type, torch.bfloat16):
            outputs = network(inputs)
        parts = losses(outputs, targets, size)
        optimiser.zero_grad(set_to_none=True)
        parts.total.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 10.0)
        optimiser.step()
        step += 1
        follow(mean, network, min(_MEMORY, (1 + step) / (10 + step)))
        sums.append(parts.figures)
        if step % _KEEP_EVERY == 0 or step == recipe.steps:
            seconds = before + time.monotonic() - begun
            keep(folder, (step, seconds), network, mean, optimiser)
            yield Progress(step, tuple(np.mean(sums, axis=0).tolist()), seconds)
            sums.clear()


def _source(
    pictures: Pictures, recipe: Recipe, step: int, rng: np.random.Generator
) -> tuple[tuple[int, int], Callable[[], Sample]]:
    """Size to train at, and what draws a picture for it."""
    height, width = recipe.size
    if step < recipe.halved:
        return (height // 2, width // 2), lambda: pictures.halved(int(rng.integers(len(pictures))))
    return (height, width), lambda: pictures[int(rng.integers(len(pictures)))]


def optimiser_of(network: nn.Module, rate: float, decay: float) -> torch.optim.Optimizer:
    """AdamW that lets biases and norms be."""
    matrices = [p for p in network.parameters() if p.ndim > 1]
    others = [p for p in network.parameters() if p.ndim <= 1]
    groups = [
        {"params": matrices, "weight_decay": decay},
        {"params": others, "weight_decay": 0.0},
    ]
    return torch.optim.AdamW(groups, lr=rate, betas=(0.9, 0.99))


def schedule(step: int, steps: int) -> float:
    """Rise, then fall as a cosine to a hundredth."""
    if step < _WARM_UP:
        return (step + 1) / _WARM_UP
    share = (step - _WARM_UP) / max(1, steps - _WARM_UP)
    return 0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * share))


@torch.no_grad()
def follow(mean: nn.Module, network: nn.Module, memory: float) -> None:
    """Move the running mean of the weights; `memory` (0 to 1) of it stays."""
    state = network.state_dict()
    for name, value in mean.state_dict().items():
        if value.dtype.is_floating_point:
            value.mul_(memory).add_(state[name], alpha=1 - memory)
        else:
            value.copy_(state[name])


def keep(
    folder: Path,
    progress: tuple[int, float],
    network: nn.Module,
    mean: nn.Module,
    optimiser: torch.optim.Optimizer,
) -> None:
    """Write the checkpoint: `progress` is the step and the seconds since the very beginning."""
    folder.mkdir(parents=True, exist_ok=True)
    everything = {
        "step": progress[0],
        "seconds": progress[1],
        "network": network.state_dict(),
        "mean": mean.state_dict(),
        "optimiser": optimiser.state_dict(),
    }
    for name, content in (("training.pt", everything), ("weights.pt", mean.state_dict())):
        partial = folder / f"{name}.partial"
        torch.save(content, partial)
        partial.rename(folder / name)


def resume(
    folder: Path, network: nn.Module, mean: nn.Module, optimiser: torch.optim.Optimizer
) -> tuple[int, float]:
    """Load the checkpoint, if there is one; returns its step and seconds, or zeros."""
    path = folder / "training.pt"
    if not path.exists():
        return 0, 0.0
    kept = torch.load(path, weights_only=True)
    network.load_state_dict(kept["network"])
    mean.load_state_dict(kept["mean"])
    optimiser.load_state_dict(kept["optimiser"])
    return int(kept["step"]), float(kept["seconds"])
