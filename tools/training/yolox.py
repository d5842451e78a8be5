"""The frozen part of the detector: YOLOX-nano as its authors define and released it (Megvii).

Its weights were learnt from photographs (COCO). What is learnt from renders stands on its features
and never changes them, which is what makes it work on photographs, too (Hinterstoisser et al.,
"On Pre-Trained Image Features and Synthetic Images for Deep Learning", 2018). The architecture is
that of Ge et al., "YOLOX: Exceeding YOLO Series in 2021", depthwise; batch norms are folded in.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.nn import functional

__all__ = ["CAR", "FEATURES", "PERSON", "Features", "FrozenYolox", "released_weights"]

FEATURES = (32, 64, 128, 256, 64, 128, 256)
"""Channels of `Features`, in order."""

PERSON, CAR = (0,), (2, 5, 7)
"""COCO's classes that its own head is asked for; cars, buses and trucks are one."""

_STAGES = (16, 32, 64, 128, 256)
_FOCUS = (2, 2, 3, 3, 3)
"""Column and row in 2 x 2 pixels, colour, row and column of the kernel."""
_SPREAD = (16, 3, 6, 6)
_HEAD = 64
_KINDS = 80


class Features(NamedTuple):
    """What the frozen part sees, each (b, channels, rows, columns)."""

    stride4: Tensor
    """Of the backbone, which still tells colours well."""
    stride8: Tensor
    stride16: Tensor
    stride32: Tensor
    neck8: Tensor
    """Of the neck, which knows what is around."""
    neck16: Tensor
    neck32: Tensor


class _Conv(nn.Module):
    """Convolution and SiLU."""

    def __init__(
        self, inputs: int, outputs: int, kernel: int, stride: int = 1, groups: int = 1
    ) -> None:
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, groups=groups)

    def forward(self, x: Tensor) -> Tensor:
        """Apply it."""
        return functional.silu(self.conv(x))


def _separable(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(_Conv(inputs, inputs, 3, stride, inputs), _Conv(inputs, outputs, 1))


class _Stage(nn.Module):
    """Bottlenecks beside a way past them (CSP)."""

    def __init__(self, inputs: int, outputs: int, repeats: int = 1, *, add: bool = True) -> None:
        super().__init__()
        hidden = outputs // 2
        self.add = add
        self.enter, self.past = _Conv(inputs, hidden, 1), _Conv(inputs, hidden, 1)
        self.bottlenecks = nn.ModuleList(
            nn.Sequential(_Conv(hidden, hidden, 1), _separable(hidden, hidden))
            for _ in range(repeats)
        )
        self.leave = _Conv(2 * hidden, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Apply the stage."""
        through, past = self.enter(x), self.past(x)
        for bottleneck in self.bottlenecks:
            changed = bottleneck(through)
            through = changed + through if self.add else changed
        return self.leave(torch.cat([through, past], 1))


class _Pooling(nn.Module):
    """Context from 5, 9 and 13 cells around (SPP)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.enter, self.leave = _Conv(width, width // 2, 1), _Conv(2 * width, width, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Apply the pooling."""
        entered = self.enter(x)
        pooled = [functional.max_pool2d(entered, side, 1, side // 2) for side in (5, 9, 13)]
        return self.leave(torch.cat([entered, *pooled], 1))


class _Head(nn.Module):
    """Its own answer at one stride: box (4), objectness and the classes of COCO."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.enter = _Conv(width, _HEAD, 1)
        self.kinds = self._branch(_KINDS)
        self.boxes = self._branch(4)
        self.objects = nn.Conv2d(_HEAD, 1, 1)

    @staticmethod
    def _branch(outputs: int) -> nn.Sequential:
        body = (_separable(_HEAD, _HEAD), _separable(_HEAD, _HEAD))
        return nn.Sequential(*body, nn.Conv2d(_HEAD, outputs, 1))

    def forward(self, x: Tensor) -> Tensor:
        """Boxes (offset and log of size, in cells), and scores from 0 to 1."""
        entered = self.enter(x)
        kinds, around = self.kinds(entered), self.boxes[:-1](entered)
        boxes, objects = self.boxes[-1](around), self.objects(around)
        return torch.cat([boxes, objects.sigmoid(), kinds.sigmoid()], 1)


class FrozenYolox(nn.Module):
    """Backbone, neck and head; nothing of it learns.

    Modules stand in the order in which they run, by which released weights are assigned.
    """

    def __init__(self) -> None:
        """Make it of random weights; `released_weights` are what it is for."""
        super().__init__()
        w1, w2, w3, w4, w5 = _STAGES
        self.focus = _Conv(12, w1, 3)
        self.stage4 = nn.Sequential(_separable(w1, w2, 2), _Stage(w2, w2))
        self.stage8 = nn.Sequential(_separable(w2, w3, 2), _Stage(w3, w3, 3))
        self.stage16 = nn.Sequential(_separable(w3, w4, 2), _Stage(w4, w4, 3))
        self.stage32 = nn.Sequential(_separable(w4, w5, 2), _Pooling(w5), _Stage(w5, w5, add=False))
        self.lateral16 = _Conv(w5, w4, 1)
        self.up16 = _Stage(2 * w4, w4, add=False)
        self.lateral8 = _Conv(w4, w3, 1)
        self.up8 = _Stage(2 * w3, w3, add=False)
        self.down16 = _separable(w3, w3, 2)
        self.neck16 = _Stage(2 * w3, w4, add=False)
        self.down32 = _separable(w4, w4, 2)
        self.neck32 = _Stage(2 * w4, w5, add=False)
        self.heads = nn.ModuleList(_Head(width) for width in (w3, w4, w5))
        self.requires_grad_(requires_grad=False)

    def features(self, images: Tensor) -> Features:
        """See `images` (b, 3, rows, columns), RGB from 0 to 1, sides multiples of 32."""
        focus = functional.conv2d(
            images * 255.0, _spread(self.focus.conv.weight), self.focus.conv.bias, 2, 2
        )
        stride4 = self.stage4(functional.silu(focus))
        stride8 = self.stage8(stride4)
        stride16 = self.stage16(stride8)
        stride32 = self.stage32(stride16)
        lateral16 = self.lateral16(stride32)
        lateral8 = self.lateral8(self.up16(torch.cat([_doubled(lateral16), stride16], 1)))
        neck8 = self.up8(torch.cat([_doubled(lateral8), stride8], 1))
        neck16 = self.neck16(torch.cat([self.down16(neck8), lateral8], 1))
        neck32 = self.neck32(torch.cat([self.down32(neck16), lateral16], 1))
        return Features(stride4, stride8, stride16, stride32, neck8, neck16, neck32)

    def own(self, features: Features) -> list[Tensor]:
        """Its own answers (b, 85, rows, columns) at strides 8, 16 and 32."""
        levels = (features.neck8, features.neck16, features.neck32)
        return [head(level) for head, level in zip(self.heads, levels, strict=True)]


def _spread(weight: Tensor) -> Tensor:
    """Megvii's first kernel (n, 12, 3, 3) as one of plain RGB pixels (n, 3, 6, 6), by strides of 2.

    Theirs takes the pixels of 2 x 2 side by side, BGR. The sums are the same, and no picture has to
    be rearranged.
    """
    parts = weight.reshape(-1, *_FOCUS).permute(0, 3, 4, 2, 5, 1).reshape(-1, 3, 6, 6)
    # Not flipped, which an export would leave to be done for each picture.
    return torch.cat([parts[:, 2:], parts[:, 1:2], parts[:, :1]], 1)


def _gathered(kernel: Tensor) -> Tensor:
    """Undo `_spread`."""
    parts = kernel.flip(1).reshape(-1, 3, 3, 2, 3, 2).permute(0, 5, 3, 1, 2, 4)
    return parts.reshape(-1, 12, 3, 3)


def _doubled(x: Tensor) -> Tensor:
    return functional.interpolate(x, scale_factor=2.0, mode="nearest")


def released_weights(path: Path) -> FrozenYolox:
    """Load Megvii's weights, of the model that they released or of a detector made of it.

    Both are ONNX files whose first convolutions are those of `FrozenYolox`, in its order. Raises
    ValueError where they are not.
    """
    graph = onnx.load(str(path)).graph
    constants = {item.name: item for item in graph.initializer}
    found = [node.input for node in graph.node if node.op_type == "Conv"]
    network = FrozenYolox()
    convs = [module for module in network.modules() if isinstance(module, nn.Conv2d)]
    if len(found) < len(convs):
        raise ValueError(f"{path} has {len(found)} convolutions, and YOLOX-nano {len(convs)}")
    for number, (conv, (_, *names)) in enumerate(zip(convs, found, strict=False)):
        for parameter, name in zip((conv.weight, conv.bias), names, strict=True):
            value = torch.from_numpy(numpy_helper.to_array(constants[name]).copy())
            if value.shape == _SPREAD:
                value = _gathered(value)
            if parameter is None or value.shape != parameter.shape:
                raise ValueError(f"{path} is not made of YOLOX-nano: convolution {number} differs")
            parameter.data.copy_(value)
    return network.eval()
