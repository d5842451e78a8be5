"""What the network is asked to get right.

Cells are assigned to things by how well they do already (TOOD: Feng et al., 2021, as in YOLOv8):
boxes by complete IoU (Zheng et al., 2020), classes by cross entropy with the IoU as their target.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import torch
from torch import Tensor
from torch.nn import functional

from tools.training.network import anchors_of, decode_boxes

__all__ = ["Losses", "Targets", "losses", "overlaps"]

_CANDIDATES = 10
_SCORE_POWER, _OVERLAP_POWER = 0.5, 6.0
_WORTH = (1.5, 0.5, 1.0, 1.0)
"""Of a vest, a person, a car and a tower: drones are led by vests, and people are the most."""
_FALSE = (2.0, 0.0, 0.0, 2.0)
"""What more a cell weighs, times its score, that answers for such a thing where none is."""


@dataclass(frozen=True)
class Targets:
    """Labels of a batch, padded to the same number."""

    kinds: Tensor
    """(b, m) class numbers."""
    boxes: Tensor
    """(b, m, 4) left, top, right, bottom in pixels."""
    valid: Tensor
    """(b, m) true where there is a label."""


@dataclass(frozen=True)
class Losses:
    """The parts of the loss, each a scalar."""

    box: Tensor
    kind: Tensor

    @property
    def total(self) -> Tensor:
        """Weighted sum."""
        return 7.5 * self.box + self.kind

    @property
    def figures(self) -> tuple[float, float]:
        """Both parts as numbers."""
        return self.box.item(), self.kind.item()


def overlaps(one: Tensor, other: Tensor, *, complete: bool = False) -> Tensor:
    """IoU, or complete IoU, of boxes (..., 4) that broadcast against each other."""
    low = torch.maximum(one[..., :2], other[..., :2])
    high = torch.minimum(one[..., 2:], other[..., 2:])
    inner = (high - low).clamp(min=0).prod(-1)
    size, other_size = one[..., 2:] - one[..., :2], other[..., 2:] - other[..., :2]
    iou = inner / (size.prod(-1) + other_size.prod(-1) - inner + 1e-7)
    if not complete:
        return iou
    around = torch.maximum(one[..., 2:], other[..., 2:]) - torch.minimum(
        one[..., :2], other[..., :2]
    )
    diagonal = around.square().sum(-1) + 1e-7
    apart = (one[..., :2] + one[..., 2:] - other[..., :2] - other[..., 2:]).square().sum(-1) / 4
    slant = torch.atan(other_size[..., 0] / (other_size[..., 1] + 1e-7))
    slant = slant - torch.atan(size[..., 0] / (size[..., 1] + 1e-7))
    shape = 4 / math.pi**2 * slant.square()
    weight = (shape / (shape - iou + 1 + 1e-7)).detach()
    return iou - apart / diagonal - weight * shape


def losses(outputs: tuple[Tensor, Tensor], targets: Targets, size: tuple[int, int]) -> Losses:
    """Compare raw outputs for inputs of `size` (height, width) with the labels."""
    raw_boxes, logits = (output.float() for output in outputs)
    centres, strides = _anchors(size, raw_boxes.device)
    boxes = decode_boxes(raw_boxes, centres, strides).transpose(1, 2)
    with torch.no_grad():
        owner, quality = _assign(boxes, logits.sigmoid().transpose(1, 2), targets, centres, strides)
    wanted = torch.zeros_like(logits).transpose(1, 2)
    chosen = owner >= 0
    batch, cell = chosen.nonzero(as_tuple=True)
    thing = owner[batch, cell]
    kinds = targets.kinds[batch, thing]
    weight = quality[batch, cell]
    wanted[batch, cell, kinds] = weight
    normal = weight.sum().clamp(min=1.0)
    worth = torch.tensor(_WORTH, device=logits.device)
    given = logits.transpose(1, 2)
    false = torch.tensor(_FALSE, device=logits.device) * given.detach().sigmoid()
    entropy = functional.binary_cross_entropy_with_logits(
        given, wanted, worth * torch.where(wanted > 0, 1.0, 1.0 + false), reduction="sum"
    )
    fit = overlaps(boxes[batch, cell], targets.boxes[batch, thing], complete=True)
    return Losses(((1 - fit) * weight * worth[kinds]).sum() / normal, entropy / normal)


@cache
def _anchors(size: tuple[int, int], device: torch.device) -> tuple[Tensor, ...]:
    return tuple(part.to(device) for part in anchors_of(size))


def _assign(
    boxes: Tensor, scores: Tensor, targets: Targets, centres: Tensor, strides: Tensor
) -> tuple[Tensor, Tensor]:
    """Of each cell (b, n): the label that it answers for, or -1, and how well it should score."""
    u, v = centres
    left, top, right, bottom = targets.boxes.unbind(-1)
    # A thing smaller than a cell would own none: widen it to the cells around its middle.
    reach = 0.75 * strides[0]
    middle_u, middle_v = (left + right)[..., None] / 2, (top + bottom)[..., None] / 2
    inside = (
        (u > torch.minimum(left[..., None], middle_u - reach))
        & (u < torch.maximum(right[..., None], middle_u + reach))
        & (v > torch.minimum(top[..., None], middle_v - reach))
        & (v < torch.maximum(bottom[..., None], middle_v + reach))
        & targets.valid[..., None]
    )
    fit = overlaps(targets.boxes[:, :, None], boxes[:, None]).clamp(min=0)
    kinds = targets.kinds[..., None].expand(-1, -1, boxes.shape[1])
    score = scores.transpose(1, 2).gather(1, kinds)
    metric = score**_SCORE_POWER * fit**_OVERLAP_POWER
    metric = torch.where(inside, metric + 1e-9, torch.zeros_like(metric))
    best = metric.topk(min(_CANDIDATES, metric.shape[-1]), dim=-1)
    positive = torch.zeros_like(metric, dtype=torch.bool).scatter_(2, best.indices, best.values > 0)
    # A cell that several things claim goes to the one that its box fits best.
    claim = torch.where(positive, fit + 1e-9, torch.zeros_like(fit))
    most, owner = claim.max(dim=1)
    positive &= torch.arange(claim.shape[1], device=claim.device)[None, :, None] == owner[:, None]
    metric = metric * positive
    top_metric = metric.amax(-1, keepdim=True)
    top_fit = (fit * positive).amax(-1, keepdim=True)
    quality = (metric / (top_metric + 1e-12) * top_fit).amax(1)
    return torch.where(most > 0, owner, -1), quality
