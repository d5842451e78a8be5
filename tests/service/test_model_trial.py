"""Models that users bring are run once, in a process of bounded memory, before they are kept."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper
from synthetic_models import constant_model

from aerodaas.analytics.models import DETECTOR
from aerodaas.errors import ConfigError
from aerodaas.service.models.model_store import ModelStore
from aerodaas.service.models.model_trial import try_model


def greedy_model(path: Path, *axes: int, from_input: bool = False) -> Path:
    """A model of a kilobyte that fills a tensor of these axes, and tells its sum."""
    picture = helper.make_tensor_value_info("images", TensorProto.FLOAT, (1, 3, 64, 64))
    found = helper.make_tensor_value_info("output0", TensorProto.FLOAT, (1,))
    nodes = [
        helper.make_node("ConstantOfShape", ["axes"], ["filled"]),
        helper.make_node("ReduceSum", ["filled"], ["all"], keepdims=0),
        helper.make_node("ReduceSum", ["images"], ["seen"], keepdims=0),
        helper.make_node("Add", ["all", "seen"], ["sum"]),
        helper.make_node("Reshape", ["sum", "one"], ["output0"]),
    ]
    known = {"axes": np.array(axes, np.int64), "one": np.array([1], np.int64)}
    if from_input:
        # Not to be folded before the model runs.
        nodes[0:1] = [
            helper.make_node("Shape", ["images"], ["four"]),
            helper.make_node("Mul", ["four", "axes"], ["long"]),
            helper.make_node("ConstantOfShape", ["long"], ["filled"]),
        ]
    initializers = [numpy_helper.from_array(value, name) for name, value in known.items()]
    graph = helper.make_graph(nodes, "greedy", [picture], [found], initializers)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.save(model, str(path))
    assert path.stat().st_size < 2000
    return path


@pytest.mark.parametrize("from_input", [False, True])
def test_a_small_file_that_takes_gigabytes_is_refused(tmp_path: Path, *, from_input: bool) -> None:
    """Whether it takes them as it is loaded or as it runs."""
    path = greedy_model(tmp_path / "a.onnx", 40, 40, 20, 40, from_input=from_input)
    if not from_input:
        path = greedy_model(path, 1500, 1000, 1000)
    with pytest.raises(ConfigError, match="choose a smaller one"):
        try_model(path)


def test_a_shape_that_is_declared_too_large_is_refused(tmp_path: Path) -> None:
    """Before anything runs."""
    small, huge = np.zeros((1, 5), np.float32), (1, 3, 1 << 14, 1 << 14)
    path = constant_model(tmp_path / "a.onnx", [small], shape=huge)
    with pytest.raises(ConfigError, match="3072 MiB for 'images' alone"):
        try_model(path)


def test_a_model_that_can_be_flown_passes(tmp_path: Path) -> None:
    """What is no model at all is for its mission to tell."""
    try_model(DETECTOR)
    try_model(greedy_model(tmp_path / "a.onnx", 100, 100))
    (tmp_path / "b.onnx").write_bytes(b"no model")
    try_model(tmp_path / "b.onnx")


def test_a_model_that_is_refused_is_not_kept(tmp_path: Path) -> None:
    """Nor anything of it."""

    def refuse(_: Path) -> None:
        raise ConfigError("too much")

    shelf, name = ModelStore(tmp_path, refuse), hashlib.sha256(b"model").hexdigest()
    with pytest.raises(ConfigError, match="too much"):
        shelf.put("farm", name, b"model")
    assert not shelf.has("farm", name)
    assert [one for one in tmp_path.rglob("*") if one.is_file()] == []
