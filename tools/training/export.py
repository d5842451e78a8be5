"""From weights to the ONNX files that ship; the detector is laid out as Ultralytics' are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import onnx
import torch
from onnx import ModelProto, compose, numpy_helper
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from aerodaas.analytics.models import DETECTOR_CLASSES
from tools.training.fusion import FusedDetector
from tools.training.heads import DetectorHeads
from tools.training.network import STRIDES, DetectorNetwork
from tools.training.yolox import FEATURES, OWN, SIZE, frozen_part

__all__ = ["Parts", "export_detector", "fused", "heads_of", "network_in", "network_of", "save_onnx"]

_PREFIX = "learnt/"
_NETWORK = "network."
_OUTPUT = "output0"


@dataclass(frozen=True)
class Parts:
    """What the detector consists of."""

    network: DetectorNetwork
    """What learnt from renders alone, its batch norms folded."""
    heads: DetectorHeads
    """What learnt from renders on frozen features, likewise."""
    source: ModelProto
    """Megvii's YOLOX-nano, or a detector made of it."""


def network_of(weights: Path) -> DetectorNetwork:
    """Read a trained network."""
    network = DetectorNetwork()
    network.load_state_dict(torch.load(weights, weights_only=True, map_location="cpu"))
    fused(network.eval())
    return network


def network_in(path: Path) -> DetectorNetwork:
    """Take the network out of an exported detector."""
    network = DetectorNetwork()
    fused(network.eval())
    names = {
        tensor.name.removeprefix(_PREFIX): tensor for tensor in onnx.load(path).graph.initializer
    }
    network.load_state_dict(
        {
            name.removeprefix(_NETWORK): torch.tensor(numpy_helper.to_array(tensor))
            for name, tensor in names.items()
            if name.startswith(_NETWORK)
        }
    )
    return network


def heads_of(weights: Path) -> DetectorHeads:
    """Read trained heads."""
    heads = DetectorHeads()
    heads.load_state_dict(torch.load(weights, weights_only=True, map_location="cpu"))
    fused(heads.eval())
    return heads


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
    parts: Parts, path: Path, thresholds: Mapping[str, float], *, released: bool = True
) -> None:
    """Write the detector; `thresholds` and `released` as `FusedDetector` takes them."""
    frozen = frozen_part(parts.source)
    names = [*FEATURES, *OWN]
    ports = [f"frozen{number}" for number in range(len(names))]
    shapes = [
        [axis.dim_value for axis in output.type.tensor_type.shape.dim]
        for output in frozen.graph.output
    ]
    with TemporaryDirectory() as folder:
        file = Path(folder, "learnt.onnx")
        torch.onnx.export(
            FusedDetector(parts.network, parts.heads, thresholds, released=released).eval(),
            (torch.zeros(1, 3, *SIZE), *(torch.zeros(shape) for shape in shapes)),
            str(file),
            input_names=["images", *ports],
            output_names=[_OUTPUT],
            opset_version=frozen.opset_import[0].version,
            dynamo=False,
        )
        learnt = compose.add_prefix(onnx.load(str(file)), _PREFIX)
    learnt.ir_version = frozen.ir_version
    links = [(name, _PREFIX + port) for name, port in zip(names, ports, strict=True)]
    whole = compose.merge_models(frozen, learnt, io_map=links)
    _rename(whole, {f"{_PREFIX}images": "images", _PREFIX + _OUTPUT: _OUTPUT})
    properties = {
        "description": "AeroDaaS, trained on rendered pictures, beside Megvii's YOLOX-nano",
        "author": "AeroDaaS",
        "license": "Apache-2.0",
        "task": "detect",
        "names": str(dict(enumerate(DETECTOR_CLASSES))),
        "stride": str(max(STRIDES)),
        "batch": "1",
        "imgsz": str(list(SIZE)),
    }
    _save(whole, path, properties)


def _rename(model: ModelProto, names: Mapping[str, str]) -> None:
    """Give tensors other names; of inputs that become one, the first stays."""
    for node in model.graph.node:
        node.input[:] = [names.get(name, name) for name in node.input]
        node.output[:] = [names.get(name, name) for name in node.output]
    model.graph.output[0].name = names.get(model.graph.output[0].name, model.graph.output[0].name)
    for port in list(model.graph.input):
        if port.name in names:
            model.graph.input.remove(port)


def save_onnx(
    model: nn.Module,
    path: Path,
    ports: tuple[str, str],
    example: Tensor,
    metadata: dict[str, str],
) -> None:
    """Write `model` with one input and one output, called `ports`, and `metadata`.

    The first axis of both is free.
    """
    torch.onnx.export(
        model.eval(),
        (example,),
        str(path),
        input_names=[ports[0]],
        output_names=[ports[1]],
        dynamic_axes={port: {0: "count"} for port in ports},
        opset_version=17,
        dynamo=False,
    )
    properties = {
        "description": "AeroDaaS, trained on rendered pictures",
        "author": "AeroDaaS",
        "license": "Apache-2.0",
        **metadata,
    }
    _save(onnx.load(str(path)), path, properties)


def _save(model: ModelProto, path: Path, properties: dict[str, str]) -> None:
    onnx.helper.set_model_props(model, properties)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
