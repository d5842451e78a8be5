"""What the network is asked to get right.

Cells are assigned to things by how well they do already (TOOD: Feng et al., 2021, as in YOLOv8):
boxes by complete IoU (Zheng et al., 2020), classes by cross entropy with the IoU as their target,
keypoints by their similarity relative to the person's size, as COCO measures it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from aerodaas.training.metrics import SIGMAS
from aerodaas.training.network import anchors_of, decode_boxes, decode_points

__all__ = ["Losses", "Targets", "losses", "overlaps"]

_CANDIDATES = 10
_SCORE_POWER, _OVERLAP_POWER = 0.5, 6.0
_PERSON = 1
_SIGMAS = 2 * torch.from_numpy(SIGMAS).float()


@dataclass(frozen=True)
class Targets:
    """Labels of a batch, padded to the same number."""

    kinds: Tensor
    """(b, m) class numbers."""
    boxes: Tensor
    """(b, m, 4) left, top, right, bottom in pixels."""
    keypoints: Tensor
    """(b, m, 17, 3)."""
    valid: Tensor
    """(b, m) true where there is a label."""


@dataclass(frozen=True)
class Losses:
    """The parts of the loss, each a scalar."""

    box: Tensor
    kind: Tensor
    place: Tensor
    seen: Tensor

    @property
    def total(self) -> Tensor:
        """Weighted sum."""
        return 7.5 * self.box + 1.0 * self.kind + 3.0 * self.place + 0.6 * self.seen

    @property
    def figures(self) -> tuple[float, ...]:
        """The four parts as numbers."""
        return tuple(part.item() for part in (self.box, self.kind, self.place, self.seen))


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


def losses(
    outputs: tuple[Tensor, Tensor, Tensor], targets: Targets, size: tuple[int, int]
) -> Losses:
    """Compare raw outputs for inputs of `size` (height, width) with the labels."""
    raw_boxes, logits, raw_points = (output.float() for output in outputs)
    centres, strides = (part.to(raw_boxes.device) for part in anchors_of(size))
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
    kind = functional.binary_cross_entropy_with_logits(
        logits.transpose(1, 2), wanted, reduction="sum"
    )
    fit = overlaps(boxes[batch, cell], targets.boxes[batch, thing], complete=True)
    place, seen = _keypoint_losses(raw_points, targets, (batch, cell, thing), (centres, strides))
    return Losses(((1 - fit) * weight).sum() / normal, kind / normal, place, seen)


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


def _keypoint_losses(
    raw: Tensor,
    targets: Targets,
    chosen: tuple[Tensor, Tensor, Tensor],
    grid: tuple[Tensor, Tensor],
) -> tuple[Tensor, Tensor]:
    batch, cell, thing = chosen
    people = targets.kinds[batch, thing] == _PERSON
    if not bool(people.any()):
        return raw.sum() * 0.0, raw.sum() * 0.0
    batch, cell, thing = batch[people], cell[people], thing[people]
    points = decode_points(raw, *grid)[batch, :, :, cell]
    labels = targets.keypoints[batch, thing]
    box = targets.boxes[batch, thing]
    area = (box[:, 2:] - box[:, :2]).prod(-1)[:, None]
    inside = (labels[..., 2] > 0).float()
    away = (points[..., :2] - labels[..., :2]).square().sum(-1)
    exponent = away / (2 * _SIGMAS.to(raw.device).square() * (0.53 * area + 1e-6))
    # Similarity alone says nothing about points far away.
    far = (away + 1e-6).sqrt() / (area + 1e-6).sqrt()
    place = (1 - torch.exp(-exponent) + far) * inside
    each = inside.sum(1).clamp(min=1.0)
    seen = functional.binary_cross_entropy_with_logits(
        points[..., 2], (labels[..., 2] > 1).float(), reduction="mean"
    )
    return (place.sum(1) / each).mean(), seen
