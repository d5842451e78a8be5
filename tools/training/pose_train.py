"""The keypoint network's training: cuts of people, and what is lost on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from tools.training.data_parallel import local_batch
from tools.training.loop import Course, Progress, learn
from tools.training.pose_cuts import Cut, People
from tools.training.pose_network import STRIDE, Joints, places

__all__ = ["PoseRecipe", "train_pose"]

_BLUR = 1.1
"""Cells: standard deviation of the joint in its heat map."""

_HIDDEN = 0.3
"""Weight of the place of a joint that something hides."""

_NEAR = 0.1
"""A joint this far off, in sizes of the person, is found to exp(-1/2)."""


@dataclass(frozen=True)
class PoseRecipe(Course):
    """What the keypoint network's training depends on, beside the people."""

    steps: int = 4000
    memory: float = 0.998
    clip: float = 5.0


def train_pose(people: People, recipe: PoseRecipe, folder: Path) -> Iterator[Progress]:
    """Train, or go on with it, in `folder`; yields as it goes."""
    torch.manual_seed(recipe.seed)
    network = Joints()

    def loss(
        _: int, rng: np.random.Generator, device: torch.device
    ) -> tuple[Tensor, tuple[float, ...]]:
        cuts = [
            people.cut(int(rng.integers(len(people))), rng)
            for _ in range(local_batch(recipe.batch))
        ]
        pixels, points, sizes = (part.to(device) for part in _batch(cuts))
        with torch.autocast(device.type, torch.bfloat16):
            maps, found = network(pixels.contiguous(memory_format=torch.channels_last))
        where, whether = _losses(maps.float(), found.float(), points, sizes)
        return where + whether, (float(where.detach()), float(whether.detach()))

    yield from learn(network, loss, recipe, folder)


def _batch(cuts: list[Cut]) -> tuple[Tensor, Tensor, Tensor]:
    """Pixels (b, 3, s, s), RGB from 0 to 1; keypoints (b, 17, 3); sizes (b,)."""
    images = np.ascontiguousarray(np.stack([cut.image for cut in cuts])[..., ::-1])
    pixels = torch.from_numpy(images).permute(0, 3, 1, 2).float() / 255
    points = torch.from_numpy(np.stack([cut.keypoints for cut in cuts]))
    return pixels, points, torch.tensor([cut.size for cut in cuts])


def _losses(maps: Tensor, found: Tensor, points: Tensor, sizes: Tensor) -> tuple[Tensor, Tensor]:
    """Where joints are (divergence of the heat maps), and whether they are found.

    A joint counts as found so far as it is seen and its place is right, so that the confidence
    tells both.
    """
    seen = points[..., 2]
    target = _heat(points[..., :2] / STRIDE, maps.shape[-1])
    logs = maps.flatten(2).log_softmax(2)
    divergence = functional.kl_div(logs, target, reduction="none").sum(2)
    weight = (seen >= 2).float() + _HIDDEN * (seen == 1).float()  # noqa: PLR2004 - visible
    where = (divergence * weight).sum() / weight.sum().clamp(min=1.0)
    with torch.no_grad():
        away = (places(maps) - points[..., :2]).square().sum(2)
        right = (-0.5 * away / (_NEAR * sizes[:, None]).square()).exp()
        right = torch.where(seen >= 2, right, torch.zeros_like(right))  # noqa: PLR2004 - visible
    return where, functional.binary_cross_entropy_with_logits(found, right)


def _heat(centres: Tensor, side: int) -> Tensor:
    """Probabilities of the cells (b, 17, side²) around centres (b, 17, 2) in cells."""
    middles = torch.arange(side, device=centres.device) + 0.5
    along = -0.5 * ((middles - centres[..., None]) / _BLUR).square()
    logits = along[..., 0, None, :] + along[..., 1, :, None]
    return logits.flatten(2).softmax(2)
