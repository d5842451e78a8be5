"""From weights to the ONNX files that ship; the detector is laid out as Ultralytics' are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import onnx
import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from aerodaas.analytics.models import DETECTOR_CLASSES
from tools.training.network import STRIDES, DetectorNetwork, anchors_of, decode_boxes
from tools.training.restart import mix
from tools.training.yolox import CAR, PERSON, FrozenYolox

__all__ = ["NOMINAL_SCORE", "SIZE", "export_detector", "fused", "save_onnx"]

SIZE = (256, 384)
"""Height and width of the input at most, between 4:3 and 16:9: either leaves a seventh of it empty.

The file takes any multiples of 32 instead, so that nothing need be spent on what is empty.
"""

_AXES = {"images": {2: "height", 3: "width"}, "output0": {2: "boxes"}}
"""Names of the axes that vary."""

NOMINAL_SCORE = 0.3
"""What a score at the best threshold is turned into, so that one threshold suits all classes."""

_RELEASED = {"person": PERSON, "car": CAR}
"""What YOLOX's own head answers for."""


class _Detector(nn.Module):
    """Boxes (centre, size) and class scores, (1, 4 + classes, n): learnt ones, then YOLOX's own."""

    def __init__(
        self, frozen: FrozenYolox, network: DetectorNetwork, thresholds: list[float]
    ) -> None:
        super().__init__()
        self.frozen, self.network = frozen, network
        shifts = [_logit(NOMINAL_SCORE) - _logit(threshold) for threshold in thresholds]
        self.shifts = torch.tensor(shifts)[None, :, None]

    def forward(self, pixels: Tensor) -> Tensor:
        """Find things."""
        features = self.frozen.features(pixels)
        own = self.frozen.own(features)  # first: `released_weights` reads the file in this order
        raw, logits = self.network(features)
        height, width = pixels.shape[2:]
        anchors = anchors_of((height, width))
        boxes = _centred(decode_boxes(raw, *anchors))
        learnt = torch.cat([boxes, (logits + self.shifts).sigmoid()], 1)
        return torch.cat([learnt, self._released(own, *anchors)], 2)

    @staticmethod
    def _released(levels: list[Tensor], cells: Tensor, strides: Tensor) -> Tensor:
        rows = torch.cat([level.flatten(2) for level in levels], 2)
        centres = (rows[:, :2] - 0.5) * strides + cells
        sizes = rows[:, 2:4].exp() * strides
        objectness, kinds = rows[:, 4:5], rows[:, 5:]
        scores = [torch.zeros_like(objectness)] * len(DETECTOR_CLASSES)
        for name, numbers in _RELEASED.items():
            best = kinds[:, list(numbers)].amax(1, keepdim=True)
            scores[DETECTOR_CLASSES.index(name)] = best * objectness
        return torch.cat([centres, sizes, *scores], 1)


def _logit(share: float) -> float:
    return math.log(share / (1 - share))


def _centred(boxes: Tensor) -> Tensor:
    low, high = boxes[:, :2], boxes[:, 2:]
    return torch.cat([(low + high) / 2, high - low], 1)


def fused(module: nn.Module) -> nn.Module:
    """Fold each batch norm of `module` into the convolution before it; returns it."""
    for name, child in module.named_children():
        match list(child.children()) if isinstance(child, nn.Sequential) else []:
            case [nn.Conv2d() as conv, nn.BatchNorm2d() as norm, *rest]:
                setattr(module, name, nn.Sequential(fuse_conv_bn_eval(conv, norm), *rest))
            case _:
                setattr(module, name, fused(child))
    return module


def export_detector(
    frozen: FrozenYolox,
    weights: Path,
    path: Path,
    thresholds: list[float],
    kept: tuple[Path, float] | None = None,
) -> None:
    """Write the detector; `thresholds` are the learnt classes' best scores, made `NOMINAL_SCORE`.

    They do not move the scores of YOLOX's own head. `kept` is a detector (.onnx) and its share in
    the weights that are written. Raises ValueError where that is of another architecture.
    """
    names = dict(enumerate(DETECTOR_CLASSES))
    metadata = {
        "description": "AeroDaaS, trained on rendered pictures, on Megvii's YOLOX-nano",
        "task": "detect",
        "names": str(names),
        "stride": str(max(STRIDES)),
        "batch": "1",
        "imgsz": str(list(SIZE)),
    }
    picture = torch.zeros(1, 3, *SIZE)
    network = _load(weights)
    if kept is not None:
        mix(network, *kept)
    detector = _Detector(frozen, network, thresholds)
    save_onnx(detector, path, ("images", "output0"), picture, metadata, axes=_AXES)


def _load(weights: Path) -> DetectorNetwork:
    network = DetectorNetwork()
    network.load_state_dict(torch.load(weights, weights_only=True, map_location="cpu"))
    fused(network.eval())
    return network


def save_onnx(
    model: nn.Module,
    path: Path,
    ports: tuple[str, str],
    example: Tensor,
    metadata: dict[str, str],
    *,
    axes: Mapping[str, Mapping[int, str]],
) -> None:
    """Write `model` with one input and one output, called `ports`, and `metadata`.

    `axes` names those of each port whose length is free.
    """
    torch.onnx.export(
        model.eval(),
        (example,),
        str(path),
        input_names=[ports[0]],
        output_names=[ports[1]],
        dynamic_axes=axes,
        opset_version=17,
        dynamo=False,
    )
    file = onnx.load(str(path))
    # What the export does not infer of the output's shape the example shows.
    shape = file.graph.output[0].type.tensor_type.shape.dim
    for number, (axis, length) in enumerate(zip(shape, model(example).shape, strict=True)):
        if number not in axes.get(ports[1], {}):
            axis.dim_value = length
    properties = {
        "description": "AeroDaaS, trained on rendered pictures",
        "author": "AeroDaaS",
        "license": "Apache-2.0",
        **metadata,
    }
    onnx.helper.set_model_props(file, properties)
    onnx.checker.check_model(file)
    onnx.save(file, str(path))
