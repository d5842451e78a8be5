"""From weights to the ONNX files that ship; the detector is laid out as Ultralytics' are."""

from __future__ import annotations

import math
from pathlib import Path

import onnx
import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from aerodaas.analytics.models import DETECTOR_CLASSES
from tools.training.network import STRIDES, DetectorNetwork, anchors_of, decode_boxes

__all__ = ["NOMINAL_SCORE", "SIZE", "export_detector", "fused", "save_onnx"]

SIZE = 320
"""Pixels of the square input."""

NOMINAL_SCORE = 0.3
"""What a score at the best threshold is turned into, so that one threshold suits all classes."""


class _Detector(nn.Module):
    """Boxes (centre, size) and class scores, (1, 4 + classes, n)."""

    def __init__(self, network: DetectorNetwork, thresholds: list[float]) -> None:
        super().__init__()
        self.network = network
        self.centres, self.strides = anchors_of((SIZE, SIZE))
        shifts = [_logit(NOMINAL_SCORE) - _logit(threshold) for threshold in thresholds]
        self.shifts = torch.tensor(shifts)[None, :, None]

    def forward(self, pixels: Tensor) -> Tensor:
        """Find things."""
        maps = self.network.maps(pixels)
        raw = _joined(self.network.boxes, maps)
        logits = _joined(self.network.kinds, maps)
        boxes = _centred(decode_boxes(raw, self.centres, self.strides))
        return torch.cat([boxes, (logits + self.shifts).sigmoid()], 1)


def _logit(share: float) -> float:
    return math.log(share / (1 - share))


def _joined(heads: nn.ModuleList, maps: list[Tensor]) -> Tensor:
    return torch.cat([head(m).flatten(2) for head, m in zip(heads, maps, strict=True)], 2)


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


def export_detector(weights: Path, path: Path, thresholds: list[float]) -> None:
    """Write the detector; `thresholds` are the classes' best scores, made `NOMINAL_SCORE`."""
    names = dict(enumerate(DETECTOR_CLASSES))
    metadata = {
        "task": "detect",
        "names": str(names),
        "stride": str(max(STRIDES)),
        "batch": "1",
        "imgsz": str([SIZE, SIZE]),
    }
    picture = torch.zeros(1, 3, SIZE, SIZE)
    save_onnx(_Detector(_load(weights), thresholds), path, ("images", "output0"), picture, metadata)


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
    varying: bool = False,
) -> None:
    """Write `model` with one input and one output, called `ports`, and `metadata`.

    `varying`: the first axis of both is free.
    """
    torch.onnx.export(
        model.eval(),
        (example,),
        str(path),
        input_names=[ports[0]],
        output_names=[ports[1]],
        dynamic_axes={port: {0: "count"} for port in ports} if varying else None,
        opset_version=17,
        dynamo=False,
    )
    file = onnx.load(str(path))
    properties = {
        "description": "AeroDaaS, trained on rendered pictures",
        "author": "AeroDaaS",
        "license": "Apache-2.0",
        **metadata,
    }
    onnx.helper.set_model_props(file, properties)
    onnx.checker.check_model(file)
    onnx.save(file, str(path))
