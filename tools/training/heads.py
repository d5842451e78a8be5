"""The heads that are learnt: boxes and classes at strides 8, 16 and 32, on frozen features.

In kind they are YOLOX's and YOLOv8's (anchor-free, decoupled), with ReLU and plain distances.
"""

from __future__ import annotations

import math
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from aerodaas.analytics.models import DETECTOR_CLASSES
from tools.training.yolox import FEATURES

__all__ = ["DetectorHeads"]

_WIDTH, _TINT = 64, 16
_PRIOR = 0.01
"""Score of an untrained network."""


def _conv(inputs: int, outputs: int, kernel: int = 3, groups: int = 1) -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, 1, kernel // 2, groups=groups, bias=False),
        nn.BatchNorm2d(outputs, eps=1e-3, momentum=0.03),
        nn.ReLU(inplace=True),
    )


def _separable(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(_conv(inputs, inputs, 3, groups=inputs), _conv(inputs, outputs, 1))


def _last(outputs: int, bias: float) -> nn.Conv2d:
    last = nn.Conv2d(_WIDTH, outputs, 1)
    nn.init.constant_(cast("Tensor", last.bias), bias)
    return last


class _Head(nn.Module):
    """Boxes and classes of one level."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.enter = _conv(width, _WIDTH, 1)
        self.trunk = _separable(_WIDTH + _TINT, _WIDTH)
        rare = math.log(_PRIOR / (1 - _PRIOR))
        self.boxes = nn.Sequential(_separable(_WIDTH, _WIDTH), _last(4, 0.7))
        self.kinds = nn.Sequential(_separable(_WIDTH, _WIDTH), _last(len(DETECTOR_CLASSES), rare))

    def body(self, level: Tensor, tint: Tensor) -> Tensor:
        """What boxes and classes have in common."""
        return self.trunk(torch.cat([self.enter(level), tint], 1))


class DetectorHeads(nn.Module):
    """`network.decode_boxes` and a sigmoid make boxes and scores of what they give."""

    def __init__(self) -> None:
        """Start from random weights."""
        super().__init__()
        (shallow, _), *levels = FEATURES.values()
        self.tint = _conv(shallow, _TINT, 1)
        self.heads = nn.ModuleList(_Head(width) for width, _ in levels)

    def _levels(self) -> list[_Head]:
        return cast("list[_Head]", list(self.heads))

    def _bodies(self, shallow: Tensor, levels: tuple[Tensor, ...]) -> list[Tensor]:
        tints = [self.tint(shallow)]
        for _ in levels[1:]:
            tints.append(functional.avg_pool2d(tints[-1], 2))
        return [head.body(*both) for head, *both in zip(self._levels(), levels, tints, strict=True)]

    def kinds(self, shallow: Tensor, *levels: Tensor) -> list[Tensor]:
        """Class logits (b, c, rows, columns) at each stride, of features as in FEATURES."""
        bodies = self._bodies(shallow, levels)
        return [head.kinds(body) for head, body in zip(self._levels(), bodies, strict=True)]

    def forward(self, shallow: Tensor, *levels: Tensor) -> tuple[Tensor, Tensor]:
        """Raw distances (b, 4, n) and class logits (b, c, n) of features as in FEATURES."""
        pairs = list(zip(self._levels(), self._bodies(shallow, levels), strict=True))
        boxes = [head.boxes(body).flatten(2) for head, body in pairs]
        kinds = [head.kinds(body).flatten(2) for head, body in pairs]
        return torch.cat(boxes, 2), torch.cat(kinds, 2)
