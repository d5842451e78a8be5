"""`aerodaas models`: what there is, what a file is, and how well it does."""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from onnx import TensorProto
from synthetic_models import constant_model, patchwork_model, simcc_model
from typer.testing import CliRunner, Result

from aerodaas.analytics.models import DETECTOR, POSE
from aerodaas.analytics.models.registry import REGISTRY
from aerodaas.analytics.people.pose import PoseAnalytics
from aerodaas.cli.app import app
from aerodaas.types.errors import ConfigError, ModelError


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


@pytest.fixture
def dataset() -> Path:
    """Two pictures: one with a white block that the synthetic model sees, and an annotated dog."""
    folder = Path("data")
    folder.mkdir()
    lit = np.zeros((96, 128, 3), np.uint8)
    lit[:, :] = 255
    for name, image in (("lit.png", lit), ("dark.png", np.zeros_like(lit))):
        (folder / name).write_bytes(cv2.imencode(".png", image)[1].tobytes())
    content = {
        "images": [{"id": 1, "file_name": "lit.png"}, {"id": 2, "file_name": "dark.png"}],
        "categories": [{"id": 1, "name": "human"}, {"id": 2, "name": "robot"}],
        "annotations": [
            {"image_id": 1, "category_id": 1, "bbox": [20, 20, 40, 40]},
            {"image_id": 2, "category_id": 1, "bbox": [20, 20, 40, 40]},
            {"image_id": 2, "category_id": 2, "bbox": [20, 20, 40, 40]},
        ],
    }
    (folder / "coco.json").write_text(json.dumps(content))
    return folder


@pytest.mark.usefixtures("models")
def test_a_detector_is_evaluated(models: Callable[..., Result], dataset: Path) -> None:
    """As a table, as files, and as pictures of what went wrong."""
    pytest.importorskip("pycocotools")
    patchwork_model(Path("a.onnx"), shape=(1, 3, 96, 128))
    words = ["evaluate", "a.onnx", str(dataset / "coco.json"), "--rename", "human=person"]
    outputs = ["--json", "o.json", "--csv", "o.csv", "--worst", "worst", "--threads", "1"]
    result = models(*words, *outputs)
    assert result.exception is None, result.exception
    assert "not evaluated, for the model does not know them: robot" in result.output
    content = json.loads(Path("o.json").read_text())
    assert (content["pictures"], content["left_out"]) == (2, ["robot"])
    (person,) = content["classes"]
    assert (person["things"], person["recall"], person["false_boxes"]) == (2, 0.5, 0)
    rows = list(csv.DictReader(Path("o.csv").read_text().splitlines()))
    assert [row["label"] for row in rows] == ["person", "all"]
    assert float(rows[0]["ap50"]) == pytest.approx(person["ap50"])
    assert rows[0]["ap_small"] == "", "there is no such thing"
    assert [path.name for path in Path("worst").iterdir()] == ["001_missed_dark.jpg"]


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--json", "gone/o.json"], "cannot write gone/o.json"),
        (["--csv", "data"], "cannot write data"),
        (["--worst", "a.onnx"], "cannot write a.onnx"),
    ],
)
def test_places_that_cannot_be_written_are_refused_first(
    models: Callable[..., Result], dataset: Path, words: list[str], problem: str
) -> None:
    """Before anything is evaluated."""
    pytest.importorskip("pycocotools")
    patchwork_model(Path("a.onnx"), shape=(1, 3, 96, 128))
    rename = ["--rename", "human=person"]
    failed = models("evaluate", "a.onnx", str(dataset / "coco.json"), *rename, *words)
    assert isinstance(failed.exception, ConfigError)
    assert problem in str(failed.exception)
    assert not failed.output


def test_wrong_words_are_told(models: Callable[..., Result], dataset: Path) -> None:
    """No label in common, half a rename, a score that is none."""
    pytest.importorskip("pycocotools")
    patchwork_model(Path("a.onnx"), shape=(1, 3, 96, 128))
    words = ["evaluate", "a.onnx", str(dataset / "coco.json")]
    for more, problem in (
        ([], "--rename LABEL=CLASS"),
        (["--rename", "human"], "renamed as --rename"),
        (["--rename", "man=person"], "no label man"),
        (["--min-score", "0"], "--min-score lies between"),
        (["--pictures", "gone", "--rename", "human=person"], "cannot read gone"),
    ):
        error = models(*words, *more).exception
        assert isinstance(error, ConfigError)
        assert problem in str(error)
