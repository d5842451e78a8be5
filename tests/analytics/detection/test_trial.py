"""What no detector gives is refused while the application is built, with what may be the cause."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic_models import constant_model, endless_model

from aerodaas.analytics.detection import model_file
from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.errors import ModelError

CELLS = 20 * 20 + 10 * 10 + 5 * 5  # 160 x 160 pixels at strides of 8, 16 and 32
SHAPE = (1, 3, 160, 160)
NAMES = {"names": "{0: 'vest', 1: 'person'}"}
RNG = np.random.default_rng(4)


def grid(scores: NDArray[Any]) -> NDArray[np.float32]:
    """An output of Ultralytics' form with a box about the middle of each cell."""
    rows, columns = np.concatenate(
        [np.mgrid[s // 2 : 160 : s, s // 2 : 160 : s].reshape(2, -1) for s in (8, 16, 32)], axis=1
    )
    centres = np.stack([columns, rows])
    boxes = np.concatenate([centres, np.full((2, CELLS), 24.0)])
    return np.concatenate([boxes, scores])[None].astype(np.float32)


def quiet(classes: int) -> NDArray[np.float64]:
    """Scores of a detector that sees nothing."""
    return RNG.uniform(0, 0.02, (classes, CELLS))


def refusal(path: Path, output: NDArray[np.float32], metadata: dict[str, str]) -> str:
    """The message with which a model of this output is refused."""
    constant_model(path, [output], shape=SHAPE, metadata=metadata)
    with pytest.raises(ModelError) as caught:
        OnnxDetector(path)
    return str(caught.value)


def test_a_detector_passes(tmp_path: Path) -> None:
    """What was seen in the trial stays with it."""
    path = constant_model(tmp_path / "a.onnx", [grid(quiet(2))], shape=SHAPE, metadata=NAMES)
    trial = OnnxDetector(path).trial
    lowest, highest = trial.scores or (1.0, 1.0)
    assert trial.boxes == CELLS
    assert 0 <= lowest < highest <= 0.02
    assert trial.corners == pytest.approx((-8, 168))
    assert not trial.doubts


def test_scores_that_are_all_zero_are_refused(tmp_path: Path) -> None:
    """As after a quantisation with one scale for boxes and scores: it would fly, blind."""
    message = refusal(tmp_path / "a.onnx", grid(np.zeros((2, CELLS))), NAMES)
    assert "gives a score of zero to each of its boxes" in message
    assert "quantised" in message


def test_boxes_in_fractions_are_refused(tmp_path: Path) -> None:
    """Boxes of one pixel in the corner would be found, and none where things are."""
    output = grid(quiet(2))
    output[0, :4] /= 160
    assert "which are no pixels; export it with boxes in pixels" in refusal(
        tmp_path / "a.onnx", output, NAMES
    )


@pytest.mark.parametrize("scores", [quiet(2) * 300 - 4, quiet(2) + 1.1])
def test_scores_beyond_0_and_1_are_refused(tmp_path: Path, scores: NDArray[np.float64]) -> None:
    """Logits; they were cut to 1 and taken for certainty."""
    message = refusal(tmp_path / "a.onnx", grid(scores), NAMES)
    assert "instead of 0 to 1; export it with its sigmoid" in message


STRIPPED = {
    "pose": RNG.uniform(0, 160, (51, CELLS)),
    "segmentation": RNG.normal(0, 0.6, (32, CELLS)),
    "segmentation, small": RNG.uniform(0, 0.3, (32, CELLS)),
    "oriented boxes": RNG.uniform(-0.78, 2.35, (1, CELLS)),
    "oriented boxes, upright": RNG.uniform(0, 0.9, (1, CELLS)),
}


@pytest.mark.parametrize("kind", STRIPPED)
def test_an_export_for_another_task_without_its_metadata_is_refused(
    tmp_path: Path, kind: str
) -> None:
    """Keypoints, mask coefficients and angles are no scores of further classes."""
    output = grid(np.concatenate([quiet(15), STRIPPED[kind]]))
    message = refusal(tmp_path / "a.onnx", output, {})
    assert "keep the metadata of the export" in message


def test_an_output_without_a_finite_number_is_refused(tmp_path: Path) -> None:
    """Half precision overflows in some networks."""
    message = refusal(tmp_path / "a.onnx", grid(np.full((2, CELLS), np.nan)), NAMES)
    assert "gives no finite number" in message


def test_a_model_with_nms_that_finds_nothing_is_doubted(tmp_path: Path) -> None:
    """It may be right: there is nothing on the trial pictures."""
    path = tmp_path / "a.onnx"
    constant_model(path, [np.zeros((1, 300, 6), np.float32)], shape=SHAPE, metadata=NAMES)
    (doubt,) = OnnxDetector(path).trial.doubts
    assert "may find nothing" in doubt


def test_a_model_without_an_end_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stranger's file does not hold up whoever builds with it."""
    monkeypatch.setattr(model_file, "_LONGEST_RUN", 0.2)
    with pytest.raises(ModelError, match=r"takes more than 0\.2 s for one picture"):
        OnnxDetector(endless_model(tmp_path / "a.onnx"))
