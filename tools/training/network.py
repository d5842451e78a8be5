"""The network that learns: a pyramid and heads at strides 8, 16 and 32, on frozen features.

In kind it is YOLOv8 (anchor-free, decoupled heads, feature pyramid up and down), smaller: ReLU
and plain distances instead of SiLU and their distributions, since both run faster on a CPU.
"""

from __future__ import annotations

import math
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from aerodaas.analytics.models import DETECTOR_CLASSES
from tools.training.yolox import FEATURES, Features

__all__ = ["STRIDES", "DetectorNetwork", "anchors_of"]

STRIDES = (8, 16, 32)
_WIDTHS = (64, 96, 96)
_TINTS, _HIDDEN = 24, 48
_DROPPED = 0.1
"""Share of the frozen channels left out in training, so that no look of renders is relied on."""
_PRIOR = 0.01
"""Score of an untrained network."""


def _conv(
    inputs: int, outputs: int, kernel: int = 3, stride: int = 1, groups: int = 1
) -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, groups=groups, bias=False),
        nn.BatchNorm2d(outputs, eps=1e-3, momentum=0.03),
        nn.ReLU(inplace=True),
    )


class _Stage(nn.Module):
    """A bottleneck side by side with what passes it by (YOLOv8's C2f)."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.hidden = outputs // 2
        self.enter = _conv(inputs, 2 * self.hidden, 1)
        self.bottleneck = nn.Sequential(
            _conv(self.hidden, self.hidden), _conv(self.hidden, self.hidden)
        )
        self.leave = _conv(3 * self.hidden, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Apply the stage."""
        past, through = self.enter(x).split(self.hidden, 1)
        return self.leave(torch.cat([past, through, self.bottleneck(through)], 1))


def _branch(width: int, hidden: int, outputs: int, bias: float) -> nn.Sequential:
    """Two depthwise-separable convolutions and a linear one, which starts at `bias`."""
    body = (
        _conv(width, width, 3, groups=width),
        _conv(width, hidden, 1),
        _conv(hidden, hidden, 3, groups=hidden),
        _conv(hidden, hidden, 1),
    )
    last = nn.Conv2d(hidden, outputs, 1)
    nn.init.constant_(cast("Tensor", last.bias), bias)
    return nn.Sequential(*body, last)


class DetectorNetwork(nn.Module):
    """A pyramid and heads on frozen `Features`.

    `decode_boxes` and a sigmoid make boxes and scores of what they give.
    """

    def __init__(self) -> None:
        """Start from random weights."""
        super().__init__()
        fine, *wide = FEATURES
        self.dropped = nn.ModuleList(nn.Dropout2d(_DROPPED) for _ in FEATURES)
        self.tints = _conv(fine, _TINTS, 3, 2)
        w3, w4, w5 = _WIDTHS
        inputs = [backbone + neck for backbone, neck in zip(wide[:3], wide[3:], strict=True)]
        self.enter8 = _conv(inputs[0] + _TINTS, w3, 1)
        self.enter16, self.enter32 = _conv(inputs[1], w4, 1), _conv(inputs[2], w5, 1)
        self.up16 = _Stage(w5 + w4, w4)
        self.up8 = _Stage(w4 + w3, w3)
        self.down16 = _conv(w3, w3, 3, 2)
        self.level16 = _Stage(w3 + w4, w4)
        self.down32 = _conv(w4, w4, 3, 2)
        self.level32 = _Stage(w4 + w5, w5)
        rare = math.log(_PRIOR / (1 - _PRIOR))
        classes = len(DETECTOR_CLASSES)
        self.boxes = nn.ModuleList(_branch(w, _HIDDEN, 4, 0.7) for w in _WIDTHS)
        self.kinds = nn.ModuleList(_branch(w, _HIDDEN, classes, rare) for w in _WIDTHS)

    def _maps(self, features: Features) -> list[Tensor]:
        seen = [drop(part) for drop, part in zip(self.dropped, features, strict=True)]
        at8 = self.enter8(torch.cat([seen[1], seen[4], self.tints(seen[0])], 1))
        at16 = self.enter16(torch.cat([seen[2], seen[5]], 1))
        at32 = self.enter32(torch.cat([seen[3], seen[6]], 1))
        at16 = self.up16(torch.cat([functional.interpolate(at32, scale_factor=2.0), at16], 1))
        at8 = self.up8(torch.cat([functional.interpolate(at16, scale_factor=2.0), at8], 1))
        at16 = self.level16(torch.cat([self.down16(at8), at16], 1))
        return [at8, at16, self.level32(torch.cat([self.down32(at16), at32], 1))]

    def forward(self, features: Features) -> tuple[Tensor, Tensor]:
        """Raw distances (b, 4, n) and class logits (b, c, n)."""
        maps = self._maps(features)
        return (
            torch.cat([head(m).flatten(2) for head, m in zip(self.boxes, maps, strict=True)], 2),
            torch.cat([head(m).flatten(2) for head, m in zip(self.kinds, maps, strict=True)], 2),
        )


def anchors_of(size: tuple[int, int]) -> tuple[Tensor, Tensor]:
    """Centres (2, n) of the cells of an input of `size` (height, width), and strides (1, n)."""
    centres, strides = [], []
    for stride in STRIDES:
        rows, columns = size[0] // stride, size[1] // stride
        v, u = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
        cells = torch.stack([u.flatten(), v.flatten()]).float()
        centres.append((cells + 0.5) * stride)
        strides.append(torch.full((1, rows * columns), float(stride)))
    return torch.cat(centres, 1), torch.cat(strides, 1)


def decode_boxes(raw: Tensor, centres: Tensor, strides: Tensor) -> Tensor:
    """Boxes (b, 4, n), left, top, right, bottom in pixels, of raw distances."""
    distances = raw.clamp(-6.0, 6.0).exp() * strides
    return torch.cat([centres - distances[:, :2], centres + distances[:, 2:]], 1)
