"""ONNX files, as detectors are made from them and look at one picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.frames import Frame, Header
from tools.fuzz.scratch import scratch_file

__all__ = ["run", "seeds"]

_FILE = scratch_file(".onnx")
_SIDE = 64
_CELLS = 84
"""Cells of the strides 8, 16 and 32 in a picture of 64 x 64."""
_FRAME = Frame(Header(0, 0, "camera"), np.full((48, 80, 3), 127, np.uint8))


def seeds() -> Iterable[bytes]:
    """Detectors of each family, of a few cells and classes, that find one thing."""
    rng = np.random.default_rng(1)
    names = {"names": "{0: 'person', 1: 'car', 2: 'vest'}", "imgsz": "[64, 64]", "stride": "32"}
    boxes, scores = rng.uniform(8, 40, (1, _CELLS, 4)), rng.uniform(0, 0.05, (1, _CELLS, 3))
    scores[0, 7] = [0.1, 0.9, 0.1]
    sure, car = scores.max(axis=2, keepdims=True), np.ones((1, _CELLS, 1))
    corners = np.concatenate([boxes[..., :2], boxes[..., :2] + 9], axis=2)
    yield _model([np.concatenate([boxes, scores], axis=2).transpose(0, 2, 1)], names)
    yield _model([np.concatenate([boxes / 40, sure, scores], axis=2)], {})
    yield _model([np.concatenate([corners, sure, car], axis=2)], names)
    yield _model([np.concatenate([boxes / 64, scores], axis=2)[:, :30]], names)
    yield _model([corners, scores], names)
    yield _model([np.array([[9.0]]), corners[:, :9], sure[:, :9, 0], car[:, :9, 0]], names)


def run(data: bytes) -> None:
    """Load one model and detect in one picture."""
    _FILE.write_bytes(data)
    try:
        detector = OnnxDetector(_FILE, threads=1)
        detector.open()
        detector.detect([_FRAME])
        detector.close()
    except AeroDaaSError:
        return


def _model(outputs: Sequence[np.ndarray], metadata: dict[str, str]) -> bytes:
    """A network that reads its picture and gives `outputs`."""
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "nothing"], ["zero"]),
    ]
    constants = [numpy_helper.from_array(np.zeros((), np.float32), "nothing")]
    infos = []
    for number, output in enumerate(outputs):
        given, name = f"constant{number}", f"output{number}"
        nodes.append(helper.make_node("Add", [given, "zero"], [name]))
        constants.append(numpy_helper.from_array(output.astype(np.float32), given))
        infos.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, output.shape))
    picture = helper.make_tensor_value_info("images", TensorProto.FLOAT, (1, 3, _SIDE, _SIDE))
    graph = helper.make_graph(nodes, "detector", [picture], infos, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())
