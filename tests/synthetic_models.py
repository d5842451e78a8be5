"""ONNX files made for a test: their outputs are known, whatever the picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper


def constant_model(
    path: Path,
    outputs: Sequence[NDArray[np.generic]],
    *,
    shape: Sequence[int | str] = (1, 3, 64, 64),
    element: int = TensorProto.FLOAT,
    metadata: Mapping[str, str] | None = None,
    declared: Sequence[Sequence[int | str]] | None = None,
) -> Path:
    """Write a model that gives `outputs` for any picture; `declared` are the shapes it states."""
    shapes = declared or [output.shape for output in outputs]
    nodes, initializers, infos = [], [], []
    for index, output in enumerate(outputs):
        initializers.append(numpy_helper.from_array(output, f"constant{index}"))
        nodes.append(helper.make_node("Identity", [f"constant{index}"], [f"output{index}"]))
        kind = helper.np_dtype_to_tensor_dtype(output.dtype)
        infos.append(helper.make_tensor_value_info(f"output{index}", kind, shapes[index]))
    picture = helper.make_tensor_value_info("images", element, shape)
    graph = helper.make_graph(nodes, "constant", [picture], infos, initializers)
    return _save(path, graph, metadata)


def patchwork_model(
    path: Path, *, classes: int = 80, shape: Sequence[int | str] = ("b", 3, "h", "w")
) -> Path:
    """Write an Ultralytics-shaped model of any input size and batch.

    Scores are the mean colour, 0 to 1, of cells of stride 32, and boxes 40 times that: a white
    cell gives a box of 40 pixels about (40, 40). Smaller cells hold nothing.
    """
    nodes, flat = [], []
    for stride in (8, 16, 32):
        window = [stride, stride]
        nodes.append(
            helper.make_node(
                "AveragePool", ["images"], [f"pool{stride}"], kernel_shape=window, strides=window
            )
        )
        weight = "one" if stride == 32 else "nothing"
        nodes.append(helper.make_node("Mul", [f"pool{stride}", weight], [f"mean{stride}"]))
        nodes.append(helper.make_node("Reshape", [f"mean{stride}", "flat"], [f"flat{stride}"]))
        flat.append(f"flat{stride}")
    nodes.append(helper.make_node("Concat", flat, ["cells"], axis=2))
    nodes.append(helper.make_node("Tile", ["cells", "repeats"], ["colours"]))
    nodes.append(helper.make_node("Mul", ["colours", "scales"], ["output0"]))
    box = np.arange(3 * ((4 + classes) // 3))[None, :, None] < 4
    initializers = [
        numpy_helper.from_array(np.where(box, 40, 1).astype(np.float32), "scales"),
        numpy_helper.from_array(np.array(1, np.float32), "one"),
        numpy_helper.from_array(np.array(0, np.float32), "nothing"),
        numpy_helper.from_array(np.array([0, 3, -1], np.int64), "flat"),
        numpy_helper.from_array(np.array([1, (4 + classes) // 3, 1], np.int64), "repeats"),
    ]
    info = helper.make_tensor_value_info("output0", TensorProto.FLOAT, ["b", 4 + classes, "n"])
    picture = helper.make_tensor_value_info("images", TensorProto.FLOAT, shape)
    graph = helper.make_graph(nodes, "patchwork", [picture], [info], initializers)
    return _save(path, graph, None)


def endless_model(path: Path) -> Path:
    """Write a model that declares one output of [1, 6, 84] and never comes to it."""
    kind, shape = TensorProto.FLOAT, [1, 6, 84]
    value = helper.make_tensor_value_info
    body = helper.make_graph(
        [
            helper.make_node("Identity", ["going"], ["on"]),
            helper.make_node("Identity", ["boxes"], ["same"]),
        ],
        "body",
        [
            value("round", TensorProto.INT64, []),
            value("going", TensorProto.BOOL, []),
            value("boxes", kind, shape),
        ],
        [value("on", TensorProto.BOOL, []), value("same", kind, shape)],
    )
    constants = [
        numpy_helper.from_array(np.array(2**62, np.int64), "rounds"),
        numpy_helper.from_array(np.array(True), "true"),  # noqa: FBT003 - a constant's value
        numpy_helper.from_array(np.zeros(shape, np.float32), "start"),
    ]
    loop = helper.make_node("Loop", ["rounds", "true", "start"], ["output0"], body=body)
    picture = value("images", kind, [1, 3, 64, 64])
    graph = helper.make_graph(
        [loop], "endless", [picture], [value("output0", kind, shape)], constants
    )
    return _save(path, graph, {"names": "['vest', 'person']"})


def simcc_model(path: Path, size: tuple[int, int] = (48, 64)) -> Path:
    """Write an RTMPose-shaped model of crops of `size` (width, height), two bins a pixel.

    All its joints are where the brightest column meets the brightest row.
    """
    nodes, initializers, infos = [], [], []
    for name, axes, side in (("simcc_x", [1, 2], size[0]), ("simcc_y", [1, 3], size[1])):
        nodes += [
            helper.make_node("ReduceMean", ["input"], [f"{name}_mean"], axes=axes, keepdims=0),
            helper.make_node("MatMul", [f"{name}_mean", f"{name}_bins"], [f"{name}_wide"]),
            helper.make_node("Reshape", [f"{name}_wide", f"{name}_shape"], [f"{name}_flat"]),
            helper.make_node("Mul", [f"{name}_flat", "joints"], [name]),
        ]
        bins = np.repeat(np.eye(side, dtype=np.float32), 2, axis=1)
        shape = np.array([-1, 1, 2 * side], np.int64)
        initializers.append(numpy_helper.from_array(bins, f"{name}_bins"))
        initializers.append(numpy_helper.from_array(shape, f"{name}_shape"))
        infos.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, ["b", 17, 2 * side]))
    initializers.append(numpy_helper.from_array(np.ones((1, 17, 1), np.float32), "joints"))
    crop = helper.make_tensor_value_info("input", TensorProto.FLOAT, ["b", 3, size[1], size[0]])
    graph = helper.make_graph(nodes, "simcc", [crop], infos, initializers)
    return _save(path, graph, None)


def mosaic_model(path: Path, side: int, *, classes: int = 5) -> Path:
    """Write a YOLOX-shaped model, whose boxes and scores are functions of each cell's mean colour.

    Different enough from cell to cell that boxes overlap, tie with none, and are of all classes.
    """
    rng = np.random.default_rng(8)
    weights = rng.normal(0, 1, (5 + classes, 3, 1, 1))
    # Classes go by hue; dark cells hold things, about three cells wide.
    weights[5:] = 60 * (weights[5:] - weights[5:].mean(axis=1, keepdims=True))
    bias = np.zeros(5 + classes)
    bias[2:4], weights[4], bias[4] = 1.0, -4.0, 2.4
    constants: dict[str, NDArray[np.generic]] = {
        "full": np.array(255, np.float32),
        "weights": weights.astype(np.float32),
        "bias": bias.astype(np.float32),
        "flat": np.array([0, 5 + classes, -1], np.int64),
        "parts": np.array([4, 1 + classes], np.int64),
    }
    nodes, flat = [helper.make_node("Div", ["images", "full"], ["light"])], []
    for stride in (8, 16, 32):
        pool, cells, row = (f"{name}{stride}" for name in ("pool", "cells", "row"))
        window = [stride, stride]
        nodes += [
            helper.make_node("AveragePool", ["light"], [pool], kernel_shape=window, strides=window),
            helper.make_node("Conv", [pool, "weights", "bias"], [cells]),
            helper.make_node("Reshape", [cells, "flat"], [row]),
        ]
        flat.append(row)
    nodes += [
        helper.make_node("Concat", flat, ["raw"], axis=2),
        helper.make_node("Transpose", ["raw"], ["rows"], perm=[0, 2, 1]),
        helper.make_node("Split", ["rows", "parts"], ["boxes", "logits"], axis=2),
        helper.make_node("Sigmoid", ["logits"], ["scores"]),
        helper.make_node("Concat", ["boxes", "scores"], ["output"], axis=2),
    ]
    count = sum((side // stride) ** 2 for stride in (8, 16, 32))
    info = helper.make_tensor_value_info("output", TensorProto.FLOAT, [1, count, 5 + classes])
    picture = helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, side, side])
    initializers = [numpy_helper.from_array(value, name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "mosaic", [picture], [info], initializers)
    return _save(path, graph, {"names": str({number: f"c{number}" for number in range(classes)})})


def _save(path: Path, graph: onnx.GraphProto, metadata: Mapping[str, str] | None) -> Path:
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    helper.set_model_props(model, dict(metadata or {}))
    onnx.save(model, str(path))
    return path
