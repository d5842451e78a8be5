"""A file that is no usable detector is refused while the application is built."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto
from synthetic_models import constant_model

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.errors import ModelError
from aerodaas.messages.frames import Frame, Header

BOXES = np.zeros((1, 6, 84), np.float32)
BOXES[0, :, -1] = [32, 32, 20, 20, 0.0, 0.01]
NAMES = {"names": "{0: 'vest', 1: 'person'}"}


def refusal(path: Path, **settings: object) -> str:
    """The one message that a user gets."""
    with pytest.raises(ModelError) as caught:
        OnnxDetector(path, **settings)  # type: ignore[arg-type]
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    """Path, problem and remedy stand in one sentence."""
    message = refusal(tmp_path / "gone.onnx")
    assert "gone.onnx cannot be read (No such file" in message
    assert "give the path of an .onnx file" in message


@pytest.mark.parametrize(
    ("content", "problem"),
    [(b"", "is empty"), (b"PK\x03\x04 a PyTorch archive", "cannot be loaded"), (b"\0" * 64, "")],
)
def test_what_is_no_onnx_file_is_refused(tmp_path: Path, content: bytes, problem: str) -> None:
    """Neither an empty nor a foreign file reaches the mission."""
    path = tmp_path / "a.onnx"
    path.write_bytes(content)
    assert problem in refusal(path)


def test_a_file_cut_short_is_refused(tmp_path: Path) -> None:
    """A copy that was interrupted does not load."""
    path = constant_model(tmp_path / "a.onnx", [BOXES], metadata=NAMES)
    path.write_bytes(path.read_bytes()[:-200])
    assert "a.onnx" in refusal(path)


def test_a_classifier_is_refused(tmp_path: Path) -> None:
    """By its task where it states one, by its output otherwise."""
    scores = np.zeros((1, 1000), np.float32)
    path = constant_model(tmp_path / "a.onnx", [scores])
    assert "gives [1, 1000]" in refusal(path)
    constant_model(path, [scores], metadata={"task": "classify"})
    assert "made to classify, not to detect" in refusal(path)


@pytest.mark.parametrize(
    ("shape", "problem"),
    [
        ((1, 1, 64, 64), "pictures of 1 channels"),
        ((1, 64, 64, 3), "pictures of 64 channels"),
        ((4, 3, 64, 64), "exactly 4 pictures"),
        ((1, 3, 64), "input of 3 axes"),
    ],
)
def test_a_wrong_input_is_refused(tmp_path: Path, shape: tuple[int, ...], problem: str) -> None:
    """Only one picture of three colours, axes NCHW, fits a frame."""
    path = constant_model(tmp_path / "a.onnx", [BOXES], shape=shape, metadata=NAMES)
    assert problem in refusal(path)


def test_an_input_of_wide_integers_is_refused(tmp_path: Path) -> None:
    """Pixels are floating point or bytes."""
    path = constant_model(tmp_path / "a.onnx", [BOXES], element=TensorProto.INT64, metadata=NAMES)
    assert "tensor(int64)" in refusal(path)


def test_settings_that_cannot_work_are_refused(tmp_path: Path) -> None:
    """Unknown classes, wrong names and scores, a provider that is not there."""
    path = constant_model(tmp_path / "a.onnx", [BOXES], metadata=NAMES)
    assert "knows no class car; it knows vest, person" in refusal(path, classes=["car"])
    assert "2 classes apart, but 3 are named" in refusal(path, names=["a", "b", "c"])
    assert "min_score" in refusal(path, min_score=float("nan"))
    assert "iou" in refusal(path, iou=1.5)
    assert "threads" in refusal(path, threads=0)
    assert "fixed input of 64 x 64" in refusal(path, size=128)
    detector = OnnxDetector(path, providers=["QuantumExecutionProvider"])
    with pytest.raises(ModelError, match="has no QuantumExecutionProvider"):
        detector.open()


@pytest.mark.parametrize(
    "names", ["{0: 'vest'", "__import__('os').getcwd()", "{5: 'vest', 1: 'b'}"]
)
def test_malformed_names_are_never_evaluated(tmp_path: Path, names: str) -> None:
    """Names that cannot be read count as missing: classes go by number."""
    path = constant_model(tmp_path / "a.onnx", [BOXES], metadata={"names": names})
    assert OnnxDetector(path).names == ("0", "1")


def test_outputs_that_are_not_finite_are_dropped_and_counted(tmp_path: Path) -> None:
    """NaN in a score, NaN or infinity in a box: the good box beside them is still found."""
    raw = BOXES.copy()
    raw[0, :, 0] = [32, 32, 20, 20, 0.0, np.nan]
    raw[0, :, 1] = [np.nan, 32, 20, 20, 0.0, 0.9]
    raw[0, :, 2] = [32, 32, np.inf, 20, 0.0, 0.9]
    raw[0, :, 3] = [32, 32, 20, 20, 0.0, np.inf]
    raw[0, :, 4] = [10, 10, 10, 10, 0.0, 0.8]
    detector = OnnxDetector(constant_model(tmp_path / "a.onnx", [raw], metadata=NAMES))
    detector.open()
    (found,) = detector.detect([Frame(Header(0, 0, "cam"), np.zeros((64, 64, 3), np.uint8))])
    assert [item.box for item in found] == [pytest.approx((5, 5, 15, 15))]
    assert detector.invalid == 4


def test_thousands_of_detections_are_bounded_and_counted(tmp_path: Path) -> None:
    """A model gone wild costs neither the mission nor the frame rate: the best 300 stay."""
    count = 8400
    raw = np.zeros((1, 6, count), np.float32)
    places = np.stack(np.meshgrid(np.arange(100), np.arange(84)), -1).reshape(-1, 2)
    raw[0, :2] = places.T * 0.6 + 1
    raw[0, 2:4] = 0.4
    raw[0, 4] = np.linspace(0.5, 1, count)
    detector = OnnxDetector(constant_model(tmp_path / "a.onnx", [BOXES], metadata=NAMES))
    frame = Frame(Header(0, 0, "cam"), np.zeros((64, 64, 3), np.uint8))
    detector.preprocess([frame])
    (found,) = detector.postprocess([frame], [raw])
    assert len(found) == 300
    assert found[0].score == pytest.approx(1.0)
    assert found[-1].score > 0.95
    assert detector.excess == count - 300


@pytest.mark.parametrize("shape", [(1, 1), (1, 4000), (3000, 2), (0, 0), (1080, 1920), (64, 64)])
def test_frames_of_any_and_changing_size(tmp_path: Path, shape: tuple[int, int]) -> None:
    """Boxes never leave the frame, however odd its form; no objects is an answer too."""
    raw = BOXES.copy()
    raw[0, :, 3] = [32, 32, 200, 200, 0.0, 0.9]
    detector = OnnxDetector(constant_model(tmp_path / "a.onnx", [raw], metadata=NAMES))
    detector.open()
    height, width = shape
    for size in ((64, 64), shape, (48, 96)):
        frame = Frame(Header(0, 0, "cam"), np.zeros((*size, 3), np.uint8))
        (found,) = detector.detect([frame])
    (found,) = detector.detect([Frame(Header(0, 0, "cam"), np.zeros((*shape, 3), np.uint8))])
    assert [item.box for item in found] == ([(0, 0, width, height)] if height else [])
