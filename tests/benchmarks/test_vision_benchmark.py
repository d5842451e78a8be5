"""The benchmark is a command that explains itself and writes its figures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from bench_runs import run_benchmark
from onnx import TensorProto, helper, numpy_helper, save


def test_it_prints_a_table_and_writes_the_same_figures(tmp_path: Path) -> None:
    """With units, machine, versions and revision."""
    model = tmp_path / "tiny.onnx"
    found = np.full((1, 6, 84), 32.0, np.float32)
    found[:, 4:] = 0.01
    constant = numpy_helper.from_array(found, "constant")
    graph = helper.make_graph(
        [helper.make_node("Identity", ["constant"], ["output0"])],
        "tiny",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, 64, 64])],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 6, 84])],
        [constant],
    )
    opset = [helper.make_opsetid("", 13)]
    save(helper.make_model(graph, opset_imports=opset, ir_version=8), str(model))
    path = tmp_path / "figures" / "vision.json"
    done = run_benchmark("vision", str(model), "--rounds", "3", "--json", str(path))
    assert done.returncode == 0, done.stderr
    assert "tiny.onnx" in done.stdout
    figures = json.loads(path.read_text())
    assert figures["units"]["infer"] == "ms"
    assert figures["rows"][0]["pre"] > 0
    assert {"machine", "versions", "revision"} < set(figures)


def test_a_model_that_does_not_load_is_told_in_one_line(tmp_path: Path) -> None:
    """Exit code 2: the user's input is wrong."""
    done = run_benchmark("vision", str(tmp_path / "gone.onnx"))
    assert done.returncode == 2
    assert "gone.onnx cannot be read" in done.stderr
    assert "Traceback" not in done.stderr
