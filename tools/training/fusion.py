"""Two pairs of eyes in one detector: what learnt from renders, and what knows real pictures.

The network that learnt from renders alone draws good boxes in renders and sees vests and towers in
photographs that hold none. The heads on YOLOX's frozen features are wrong about other things, so
that the two are asked together: their log odds are averaged. People and vehicles that YOLOX's own
head finds are listed beside these.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn
from torch.nn import functional

from aerodaas.analytics.models import DETECTOR_CLASSES
from tools.training.heads import DetectorHeads
from tools.training.network import STRIDES, DetectorNetwork, anchors_of, decode_boxes
from tools.training.yolox import FEATURES, SIZE

__all__ = ["NOMINAL_SCORE", "RELEASED", "SMALL", "FusedDetector"]

SMALL = (224, 352)
"""Height and width of what the network that learnt from renders gets: somewhat more than it was
trained at, so that things in pictures of 4:3, which fill less of it, are hardly smaller."""

NOMINAL_SCORE = 0.3
"""What a score at the best threshold is turned into, so that one threshold suits all classes."""

RELEASED = {"person": (0,), "car": (2, 5, 7)}
"""What YOLOX's own head answers for, and the numbers of COCO's classes: cars, buses and trucks."""

_TRUST = 0.5
"""Weight of the heads' log odds: of 0.5 and 1, what ranks vests better in held-out renders."""

_LEAST = 1e-6


class FusedDetector(nn.Module):
    """Boxes (centre, size) and class scores, (1, 4 + classes, n)."""

    def __init__(
        self,
        network: DetectorNetwork,
        heads: DetectorHeads,
        thresholds: Mapping[str, float],
        *,
        released: bool = True,
    ) -> None:
        """Join the parts; `thresholds` are the best scores of what is learnt from renders.

        Without `released`, YOLOX's own head scores nothing, so that these can be told.
        """
        super().__init__()
        self.network, self.heads = network, heads
        self.released = RELEASED if released else {}
        self.small_anchors, self.anchors = anchors_of(SMALL), anchors_of(SIZE)
        shifts = [_logit(NOMINAL_SCORE) - _logit(thresholds[name]) for name in DETECTOR_CLASSES]
        self.shifts = torch.tensor(shifts)[None, :, None]

    def forward(self, images: Tensor, *tensors: Tensor) -> Tensor:
        """Find things in `images` (1, 3, *SIZE), with the frozen part's FEATURES and OWN."""
        features, own = tensors[: len(FEATURES)], tensors[len(FEATURES) :]
        small = functional.interpolate(images, SMALL, mode="bilinear", align_corners=False)
        raw, logits = self.network(small)
        boxes = decode_boxes(raw, *self.small_anchors)
        scale = [SIZE[1] / SMALL[1], SIZE[0] / SMALL[0]]
        boxes = boxes * torch.tensor([*scale, *scale])[None, :, None]
        centred = torch.cat([(boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]], 1)
        checked = _checked(self.heads.kinds(*features))
        pooled = (logits + _TRUST * checked) / (1 + _TRUST)
        scores = (pooled + self.shifts).sigmoid()
        return torch.cat([torch.cat([centred, scores], 1), self._of_released(own)], 2)

    def _of_released(self, own: tuple[Tensor, ...]) -> Tensor:
        rows = torch.cat([level.flatten(2) for level in own], 2)
        middles, strides = self.anchors
        centres = (rows[:, :2] - 0.5) * strides + middles
        sizes = rows[:, 2:4].exp() * strides
        objectness, kinds = rows[:, 4:5], rows[:, 5:]
        scores = [torch.zeros_like(objectness)] * len(DETECTOR_CLASSES)
        for name, numbers in self.released.items():
            best = kinds[:, list(numbers)].amax(1, keepdim=True)
            scores[DETECTOR_CLASSES.index(name)] = best * objectness
        return torch.cat([centres, sizes, *scores], 1)


def _checked(levels: list[Tensor]) -> Tensor:
    """Log odds (1, classes, n) of the heads at the cells of the other network.

    The levels' (1, classes, rows, columns) highest ones around each cell count: cells of the two
    that answer for one thing seldom lie at one place.
    """
    finest = levels[0].shape[2:]
    best = levels[0]
    for level in levels[1:]:
        best = torch.maximum(best, functional.interpolate(level, list(finest), mode="nearest"))
    parts = []
    for number, stride in enumerate(STRIDES):
        if number:
            best = functional.max_pool2d(best, 2)
        around = functional.max_pool2d(best, 3, 1, 1)
        cells = [side // stride for side in SMALL]
        at = functional.interpolate(around, cells, mode="bilinear", align_corners=False)
        parts.append(at.flatten(2))
    return torch.cat(parts, 2)


def _logit(share: float) -> float:
    return float(torch.logit(torch.tensor(share), _LEAST))
