"""`aerodaas models`: what there is, what a file is, and how well it does."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto
from synthetic_models import constant_model, patchwork_model, simcc_model
from typer.testing import CliRunner, Result

from aerodaas.analytics.models import DETECTOR, POSE
from aerodaas.analytics.models.registry import REGISTRY
from aerodaas.analytics.people.pose import PoseAnalytics
from aerodaas.cli.app import app
from aerodaas.errors import ModelError


@pytest.fixture
def models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """The command, with nothing fetched yet."""
    monkeypatch.setenv("AERODAAS_MODELS", str(tmp_path / "fetched"))
    monkeypatch.setenv("COLUMNS", "250")
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(app, ["models", *words])


def test_all_names_are_listed_with_licence_and_size(models: Callable[..., Result]) -> None:
    """And what is here already."""
    output = models("list").output
    assert all(name in output for name in REGISTRY)
    assert "Apache-2.0" in output
    assert "yes" not in output
    Path("fetched").mkdir()
    Path("fetched/yolox-nano.onnx").write_bytes(b"")
    assert "yes" in models("list").output


def test_a_file_that_is_another_is_not_added(models: Callable[..., Result]) -> None:
    """Every model of several is looked up before one is fetched."""
    Path("a.onnx").write_bytes(b"no model")
    failed = models("add", "yolox-nano", "--from", "a.onnx")
    assert isinstance(failed.exception, ModelError)
    assert "is shorter than yolox-nano" in str(failed.exception)
    assert "did you mean yolox-s?" in str(models("add", "yolox-nano", "yolox-z").exception)


def test_a_model_is_added_from_a_file(
    models: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its path and licence are what is printed; the bar is not in a script's way."""
    content = simcc_model(Path("a.onnx")).read_bytes()
    sha256 = hashlib.sha256(content).hexdigest()
    model = replace(REGISTRY["yolox-nano"], name="mine", sha256=sha256, size=len(content))
    monkeypatch.setitem(REGISTRY, "mine", model)
    result = models("add", "mine", "--from", "a.onnx")
    assert result.exception is None
    path = Path("fetched/mine.onnx").absolute()
    assert result.stdout == f"mine: {path} (Apache-2.0)\n"
    assert path.read_bytes() == content


def test_a_detector_is_described_with_its_use(models: Callable[..., Result]) -> None:
    """Family, input, classes, what the trial showed, and the line to write."""
    output = models("check", str(DETECTOR)).output
    for words in (
        "a detector of the family Ultralytics",
        "384 x 256 RGB, 0 to 1, padded",
        "4: vest, person, car, tower",
        "4032 boxes a picture",
        f"OnnxDetector({str(DETECTOR)!r}, classes=['person'])",
    ):
        assert words in output
    assert "doubt" not in output


def test_pose_networks_are_described(models: Callable[..., Result]) -> None:
    """Those on crops have an analysis of their own."""
    assert f"PoseAnalytics({str(POSE)!r})" in models("check", str(POSE)).output
    assert "crops of 48 x 64" in models("check", str(simcc_model(Path("simcc.onnx")))).output


def test_doubts_are_told(models: Callable[..., Result]) -> None:
    """Missing names, steering characters in names that are there, and silence in the trial."""
    patchwork_model(Path("a.onnx"), classes=5)
    assert "names no classes: give them with names=" in models("check", "a.onnx").output
    rows = [np.zeros((1, 300, 6), np.float32)]
    constant_model(Path("b.onnx"), rows, metadata={"names": "['\\x1b[2Jvest']"})
    output = models("check", "b.onnx").output
    assert "may find nothing" in output
    assert "\x1b" not in output


def test_what_is_no_detector_is_refused(models: Callable[..., Result]) -> None:
    """With the words that an application would get."""
    constant_model(Path("a.onnx"), [np.zeros((1, 1000), np.float32)])
    assert "the output of no detector" in str(models("check", "a.onnx").exception)


@pytest.mark.parametrize(
    ("shape", "element"),
    [((1, 3, 64, 48), TensorProto.FLOAT), (("b", 3, 64, 48), TensorProto.UINT8)],
)
def test_a_pose_network_that_no_analysis_takes_is_refused(
    models: Callable[..., Result], shape: Sequence[int | str], element: int
) -> None:
    """It runs on several crops at once, given as numbers: one crop, or bytes, are not enough."""
    outputs = [np.zeros((1, 17, bins), np.float32) for bins in (96, 128)]
    constant_model(Path("a.onnx"), outputs, shape=shape, element=element)
    assert "the output of no detector" in str(models("check", "a.onnx").exception)
    with pytest.raises(ModelError, match="finds no keypoints"):
        PoseAnalytics("a.onnx")


def test_an_output_without_axes_is_refused(models: Callable[..., Result]) -> None:
    """A count beside something else."""
    outputs = [np.array(3, np.float32), np.zeros((1, 17, 128), np.float32)]
    constant_model(Path("a.onnx"), outputs)
    assert "the output of no detector" in str(models("check", "a.onnx").exception)
