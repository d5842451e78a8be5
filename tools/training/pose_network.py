"""The keypoint network: one heat map for each joint of the body in the middle of a cut.

An hourglass of plain residual blocks: down to 1/32, where a cell sees the whole body, and up again
to 1/4, where joints are told apart.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from aerodaas.analytics.people.joints import POINTS

__all__ = ["STRIDE", "Joints", "places"]

STRIDE = 4
"""Pixels of the cut for each cell of a heat map."""

_WIDTHS = (16, 32, 64, 128, 128)
_AROUND = 2
"""Cells around the highest one that say where exactly the joint is."""


def _conv(inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
        nn.BatchNorm2d(outputs, momentum=0.03),
        nn.ReLU(inplace=True),
    )


class _Residual(nn.Module):
    """Two convolutions beside what passes them by."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.convs = nn.Sequential(_conv(width, width), _conv(width, width))

    def forward(self, x: Tensor) -> Tensor:
        """Apply the block."""
        return x + self.convs(x)


class Joints(nn.Module):
    """Cuts (b, 3, s, s), RGB from 0 to 1, to heat maps and logits of being found."""

    def __init__(self) -> None:
        """Start from random weights."""
        super().__init__()
        w1, w2, w3, w4, w5 = _WIDTHS
        self.stride_4 = nn.Sequential(_conv(3, w1, 3, 2), _conv(w1, w2, 3, 2), _Residual(w2))
        self.stride_8 = nn.Sequential(_conv(w2, w3, 3, 2), _Residual(w3), _Residual(w3))
        self.stride_16 = nn.Sequential(_conv(w3, w4, 3, 2), _Residual(w4))
        self.stride_32 = nn.Sequential(_conv(w4, w5, 3, 2), _Residual(w5))
        self.up_16 = _conv(w5, w4, 1)
        self.up_8 = nn.Sequential(_conv(w4, w3, 1), _Residual(w3))
        self.up_4 = nn.Sequential(_Residual(w3), _conv(w3, 48, 1))
        self.beside_4 = _conv(w2, 48, 1)
        self.maps = nn.Sequential(_conv(48, 48), nn.Conv2d(48, POINTS, 1))
        self.found = nn.Linear(w5, POINTS)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Logits over the cells (b, 17, s/4, s/4), and of each joint's being found (b, 17)."""
        fine = self.stride_4(x)
        middle = self.stride_8(fine)
        coarse = self.stride_16(middle)
        whole = self.stride_32(coarse)
        up = coarse + _doubled(self.up_16(whole))
        up = middle + _doubled(self.up_8(up))
        up = self.beside_4(fine) + _doubled(self.up_4(up))
        return self.maps(up), self.found(whole.mean((2, 3)))


def _doubled(x: Tensor) -> Tensor:
    return functional.interpolate(x, scale_factor=2.0)


def places(maps: Tensor) -> Tensor:
    """Joints (b, 17, 2: u, v), in pixels of the cut, of heat maps' logits (b, 17, n, n).

    The mean of the cells around the highest one, weighed by their probabilities.
    """
    side = maps.shape[-1]
    flat = maps.flatten(2)
    best = flat.argmax(2, keepdim=True)
    cells = torch.arange(side * side, device=maps.device)
    u, v = cells % side, torch.div(cells, side, rounding_mode="floor")
    best_u, best_v = best % side, torch.div(best, side, rounding_mode="floor")
    near = ((u - best_u).abs() <= _AROUND) & ((v - best_v).abs() <= _AROUND)
    weights = flat.softmax(2) * near
    weights = weights / weights.sum(2, keepdim=True)
    middles = torch.stack([u, v], 1).to(maps.dtype) + 0.5
    return STRIDE * weights @ middles
