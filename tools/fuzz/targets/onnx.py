"""ONNX files, as detectors are made from them and look at one picture."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.types.data import Frame, Header
from aerodaas.types.errors import AeroDaaSError
from tools.fuzz.scratch import scratch_file

__all__ = ["run", "seeds"]

_FILE = scratch_file(".onnx")
_SIDE = 64
_CELLS = 84
"""Cells of the strides 8, 16 and 32 in a picture of 64 x 64."""
_FRAME = Frame(Header(0, 0, "camera"), np.full((48, 80, 3), 127, np.uint8))


def seeds() -> Iterable[bytes]:
    """Detectors of two families, of a few cells and classes."""
    rng = np.random.default_rng(1)
    boxes = rng.uniform(8, 40, (1, 4, _CELLS))
    scores = rng.uniform(0, 1, (1, 3, _CELLS))
    names = {"names": "{0: 'person', 1: 'car', 2: 'vest'}", "imgsz": "[64, 64]", "stride": "32"}
    yield _model(np.concatenate([boxes, scores], axis=1).astype(np.float32), names)
    yield _model(rng.uniform(0, 1, (1, _CELLS, 8)).astype(np.float32), {})


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


def _model(output: np.ndarray, metadata: dict[str, str]) -> bytes:
    """A network that reads its picture and gives `output`."""
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "nothing"], ["zero"]),
        helper.make_node("Add", ["boxes", "zero"], ["output0"]),
    ]
    constants = [
        numpy_helper.from_array(output, "boxes"),
        numpy_helper.from_array(np.zeros((), np.float32), "nothing"),
    ]
    graph = helper.make_graph(
        nodes,
        "detector",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, (1, 3, _SIDE, _SIDE))],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, output.shape)],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())
