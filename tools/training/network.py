"""The network: one body, and heads for boxes and classes at strides 8, 16 and 32.

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

__all__ = ["STRIDES", "DetectorNetwork", "anchors_of"]

STRIDES = (8, 16, 32)
_WIDTHS = (16, 24, 48, 96, 128)
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
    """Bottlenecks side by side with what passes them by (YOLOv8's C2f)."""

    def __init__(self, inputs: int, outputs: int, repeats: int = 1, *, add: bool = True) -> None:
        super().__init__()
        self.hidden = outputs // 2
        self.add = add
        self.enter = _conv(inputs, 2 * self.hidden, 1)
        self.bottlenecks = nn.ModuleList(
            nn.Sequential(_conv(self.hidden, self.hidden), _conv(self.hidden, self.hidden))
            for _ in range(repeats)
        )
        self.leave = _conv((2 + repeats) * self.hidden, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Apply the stage."""
        parts = list(self.enter(x).split(self.hidden, 1))
        for bottleneck in self.bottlenecks:
            last = bottleneck(parts[-1])
            parts.append(parts[-1] + last if self.add else last)
        return self.leave(torch.cat(parts, 1))


class _Pooling(nn.Module):
    """Context from 5, 9 and 13 cells around (SPPF)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.enter = _conv(width, width // 2, 1)
        self.leave = _conv(2 * width, width, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Apply the pooling."""
        parts = [self.enter(x)]
        for _ in range(3):
            parts.append(functional.max_pool2d(parts[-1], 5, 1, 2))
        return self.leave(torch.cat(parts, 1))


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
    """Body and heads; `decode_boxes` and a sigmoid make boxes and scores of what they give."""

    def __init__(self) -> None:
        """Start from random weights."""
        super().__init__()
        w1, w2, w3, w4, w5 = _WIDTHS
        self.classes = len(DETECTOR_CLASSES)
        self.fine = nn.Sequential(
            _conv(3, w1, 3, 2),
            _conv(w1, w2, 3, 2),
            _Stage(w2, w2),
            _conv(w2, w3, 3, 2),
            _Stage(w3, w3),
        )
        self.middle = nn.Sequential(_conv(w3, w4, 3, 2), _Stage(w4, w4, 2))
        self.coarse = nn.Sequential(_conv(w4, w5, 3, 2), _Stage(w5, w5), _Pooling(w5))
        self.up_middle = _Stage(w5 + w4, w4, add=False)
        self.up_fine = _Stage(w4 + w3, w3, add=False)
        self.down_fine = _conv(w3, w3, 3, 2)
        self.down_middle = _Stage(w3 + w4, w4, add=False)
        self.down_coarse_enter = _conv(w4, w4, 3, 2)
        self.down_coarse = _Stage(w4 + w5, w5, add=False)
        rare = math.log(_PRIOR / (1 - _PRIOR))
        self.boxes = nn.ModuleList(_branch(w, 48, 4, 0.7) for w in (w3, w4, w5))
        self.kinds = nn.ModuleList(_branch(w, 48, self.classes, rare) for w in (w3, w4, w5))

    def maps(self, x: Tensor) -> list[Tensor]:
        """Features at each stride."""
        fine = self.fine(x)
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        up = self.up_middle(
            torch.cat([functional.interpolate(coarse, scale_factor=2.0), middle], 1)
        )
        out_fine = self.up_fine(torch.cat([functional.interpolate(up, scale_factor=2.0), fine], 1))
        out_middle = self.down_middle(torch.cat([self.down_fine(out_fine), up], 1))
        entered = self.down_coarse_enter(out_middle)
        return [out_fine, out_middle, self.down_coarse(torch.cat([entered, coarse], 1))]

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Raw distances (b, 4, n) and class logits (b, c, n)."""
        maps = self.maps(x)
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
