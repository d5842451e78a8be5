"""The loop of each training: steps, the running mean of the weights, checkpoints."""

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

from tools.training.data_parallel import average_gradients, rank

__all__ = ["Course", "Loss", "Progress", "learn"]

_WARM_UP = 150
"""Steps over which the rate of learning rises."""

_KEEP_EVERY = 250


@dataclass(frozen=True)
class Course:
    """What every training depends on, beside its pictures."""

    steps: int
    batch: int = 32
    """Pictures of a step, of all processes together."""
    rate: float = 2e-3
    decay: float = 0.03
    memory: float = 0.9985
    """Of the running mean of weights, per step."""
    clip: float = 10.0
    """Longest step of the gradient's norm."""
    seed: int = 1
    start: Path | None = None
    """Weights to begin with, instead of random ones."""
    processes: int = 1


@dataclass(frozen=True)
class Progress:
    """How far it got, and the parts of the loss, averaged over the last steps."""

    step: int
    parts: tuple[float, ...]
    seconds: float
    """Since the very beginning."""


Loss = Callable[[int, np.random.Generator, torch.device], tuple[Tensor, tuple[float, ...]]]
"""From the step, what draws, and where to calculate: a new batch's loss, and its parts."""


def learn(network: nn.Module, loss: Loss, course: Course, folder: Path) -> Iterator[Progress]:
    """Train from where `folder` has a checkpoint, or from the start; yields as it goes.

    The mean of the weights is kept in `folder/weights.pt`, everything else beside it, so that a
    training that was stopped goes on. Runs on a GPU if there is one. In a group of processes,
    each calls this with the same arguments, and the first one keeps the checkpoint.
    """
    cv2.setNumThreads(0)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network.to(device=device, memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue] - not among PyTorch's overloads
    if course.start is not None:
        network.load_state_dict(torch.load(course.start, weights_only=True, map_location=device))
    mean = copy.deepcopy(network).eval()
    optimiser = _optimiser_of(network, course.rate, course.decay)
    step, before = _resume(folder, network, mean, optimiser)
    begun = time.monotonic()
    rng = np.random.default_rng([course.seed, step, rank()])
    sums: list[tuple[float, ...]] = []
    while step < course.steps:
        network.train()
        for group in optimiser.param_groups:
            group["lr"] = course.rate * _schedule(step, course.steps)
        total, parts = loss(step, rng, device)
        optimiser.zero_grad(set_to_none=True)
        total.backward()
        average_gradients(network)
        torch.nn.utils.clip_grad_norm_(network.parameters(), course.clip)
        optimiser.step()
        step += 1
        _follow(mean, network, min(course.memory, (1 + step) / (10 + step)))
        sums.append(parts)
        if step % _KEEP_EVERY == 0 or step == course.steps:
            seconds = before + time.monotonic() - begun
            if rank() == 0:
                _keep(folder, (step, seconds), network, mean, optimiser)
            yield Progress(step, tuple(np.mean(sums, axis=0).tolist()), seconds)
            sums.clear()


def _optimiser_of(network: nn.Module, rate: float, decay: float) -> torch.optim.Optimizer:
    """AdamW that lets biases and norms be."""
    matrices = [p for p in network.parameters() if p.ndim > 1]
    others = [p for p in network.parameters() if p.ndim <= 1]
    groups = [
        {"params": matrices, "weight_decay": decay},
        {"params": others, "weight_decay": 0.0},
    ]
    return torch.optim.AdamW(groups, lr=rate, betas=(0.9, 0.99), fused=True)


def _schedule(step: int, steps: int) -> float:
    """Rise, then fall as a cosine to a hundredth."""
    if step < _WARM_UP:
        return (step + 1) / _WARM_UP
    share = (step - _WARM_UP) / max(1, steps - _WARM_UP)
    return 0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * share))


@torch.no_grad()
def _follow(mean: nn.Module, network: nn.Module, memory: float) -> None:
    """Move the running mean of the weights; `memory` (0 to 1) of it stays."""
    state = network.state_dict()
    for name, value in mean.state_dict().items():
        if value.dtype.is_floating_point:
            value.mul_(memory).add_(state[name], alpha=1 - memory)
        else:
            value.copy_(state[name])


def _keep(
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


def _resume(
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
