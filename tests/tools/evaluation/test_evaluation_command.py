"""`python -m tools.evaluation`: a detector measured on annotated pictures."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from synthetic_models import patchwork_model
from typer.testing import CliRunner, Result

from aerodaas.errors import ConfigError
from tools.evaluation.__main__ import app


@pytest.fixture
def evaluated(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """The command."""
    monkeypatch.setenv("COLUMNS", "250")
    return lambda *words: CliRunner().invoke(app, list(words))


@pytest.fixture
def dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two pictures: one with a white block that the synthetic model sees, and an annotated dog."""
    monkeypatch.chdir(tmp_path)
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


def test_a_detector_is_evaluated(evaluated: Callable[..., Result], dataset: Path) -> None:
    """As a table, as files, and as pictures of what went wrong."""
    pytest.importorskip("pycocotools")
    patchwork_model(Path("a.onnx"), shape=(1, 3, 96, 128))
    words = ["a.onnx", str(dataset / "coco.json"), "--rename", "human=person"]
    outputs = ["--json", "o.json", "--csv", "o.csv", "--worst", "worst", "--threads", "1"]
    result = evaluated(*words, *outputs)
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


def test_wrong_words_are_told(evaluated: Callable[..., Result], dataset: Path) -> None:
    """No label in common, half a rename, a score that is none."""
    pytest.importorskip("pycocotools")
    patchwork_model(Path("a.onnx"), shape=(1, 3, 96, 128))
    words = ["a.onnx", str(dataset / "coco.json")]
    for more, problem in (
        ([], "--rename LABEL=CLASS"),
        (["--rename", "human"], "renamed as --rename"),
        (["--rename", "man=person"], "no label man"),
        (["--min-score", "0"], "--min-score lies between"),
        (["--pictures", "gone", "--rename", "human=person"], "cannot read gone"),
    ):
        error = evaluated(*words, *more).exception
        assert isinstance(error, ConfigError)
        assert problem in str(error)
