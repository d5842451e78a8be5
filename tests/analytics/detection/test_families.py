"""Each kind of export is told from the file and decoded to the same boxes."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from onnx import TensorProto
from synthetic_models import constant_model, patchwork_model

from aerodaas.analytics.detection.coco import COCO_NAMES
from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.errors import ModelError
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Frame, Header

NAMES = "{0: 'vest', 1: 'person'}"
CELLS = 8 * 8 + 4 * 4 + 2 * 2  # 64 x 64 pixels at strides of 8, 16 and 32


def frame(height: int = 64, width: int = 64) -> Frame:
    """A black frame."""
    return Frame(Header(7, 99, "tello/cam"), np.zeros((height, width, 3), np.uint8))


def detect(path: Path, picture: Frame | None = None) -> Detections:
    """Detect as an actor would: the detector travels there by value."""
    detector: OnnxDetector = pickle.loads(pickle.dumps(OnnxDetector(path)))  # noqa: S301
    detector.open()
    return detector.detect([picture or frame()])[0]


def ultralytics_output(extra: int = 0, dtype: type = np.float32) -> NDArray[Any]:
    """Two overlapping persons, a vest at the same place, and nothing elsewhere."""
    raw: NDArray[Any] = np.zeros((1, 4 + 2 + extra, CELLS), dtype)
    raw[0, :6, 10] = [32, 32, 20, 40, 0.1, 0.9]
    raw[0, :6, 11] = [33, 33, 20, 40, 0.1, 0.8]
    raw[0, :6, 12] = [32, 30, 10, 12, 0.7, 0.2]
    return raw


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_ultralytics_without_nms(tmp_path: Path, dtype: type) -> None:
    """The weaker of two overlapping boxes of one class goes; another class stays."""
    element = TensorProto.FLOAT16 if dtype is np.float16 else TensorProto.FLOAT
    path = constant_model(
        tmp_path / "a.onnx",
        [ultralytics_output(dtype=dtype)],
        element=element,
        metadata={"names": NAMES, "task": "detect"},
    )
    found = detect(path)
    assert [(item.label, round(item.score, 2)) for item in found] == [
        ("person", 0.9),
        ("vest", 0.7),
    ]
    assert found[0].box == pytest.approx((22, 12, 42, 52))
    assert found.header == Header(7, 99, "tello/cam")


def test_pose_gives_keypoints_in_the_frames_pixels(tmp_path: Path) -> None:
    """Keypoints are mapped like boxes: a frame twice as large has them twice as far out."""
    raw = ultralytics_output(extra=2 * 3)
    raw[0, 6:, 10] = [30, 20, 0.9, 34, 50, 0.5]
    metadata = {"names": NAMES, "task": "pose", "kpt_shape": "[2, 3]"}
    path = constant_model(tmp_path / "a.onnx", [raw], metadata=metadata)
    found = detect(path, frame(128, 128))
    assert found[0].box == pytest.approx((44, 24, 84, 104))
    assert found[0].keypoints == pytest.approx(np.array([[60, 40, 0.9], [68, 100, 0.5]]))


def test_keypoints_without_confidence_count_as_certain(tmp_path: Path) -> None:
    """Two numbers a keypoint are filled up to three."""
    metadata = {"names": NAMES, "task": "pose", "kpt_shape": "[3, 2]"}
    path = constant_model(tmp_path / "a.onnx", [ultralytics_output(extra=6)], metadata=metadata)
    keypoints = detect(path)[0].keypoints
    assert keypoints is not None
    assert keypoints.shape == (3, 3)
    assert (keypoints[:, 2] == 1).all()


@pytest.mark.parametrize("keypoints", [0, 2])
def test_built_in_nms(tmp_path: Path, keypoints: int) -> None:
    """Rows of corners, score and class pass as they are; unused rows are left out."""
    rows = np.zeros((1, 300, 6 + 3 * keypoints), np.float32)
    rows[0, 0, :6] = [22, 12, 42, 52, 0.9, 1]
    rows[0, 1, :6] = [23, 13, 43, 53, 0.8, 1]
    rows[0, 2, :6] = [1, 1, 9, 9, 0.7, 5]
    metadata = {"names": NAMES, "end2end": "True"}
    if keypoints:
        metadata |= {"task": "pose", "kpt_shape": f"[{keypoints}, 3]"}
    detector = OnnxDetector(constant_model(tmp_path / "a.onnx", [rows], metadata=metadata))
    detector.open()
    found = detector.detect([frame()])[0]
    assert [item.label for item in found] == ["person", "person"], "the model has done its NMS"
    assert detector.invalid == 1, "class 5 does not exist"


def test_yolov5(tmp_path: Path) -> None:
    """Three boxes a cell: the score is objectness times class."""
    raw = np.zeros((1, 3 * CELLS, 7), np.float32)
    raw[0, 100] = [32, 32, 20, 40, 0.9, 0.1, 0.8]
    raw[0, 101] = [10, 10, 8, 8, 0.5, 0.5, 0.1]
    path = constant_model(tmp_path / "a.onnx", [raw], metadata={"names": NAMES, "stride": "32"})
    (found,) = detect(path)
    assert found.label == "person"
    assert found.score == pytest.approx(0.72)
    assert found.box == pytest.approx((22, 12, 42, 52))


@pytest.mark.parametrize("decoded", [False, True])
def test_yolox(tmp_path: Path, decoded: bool) -> None:  # noqa: FBT001
    """Grid and stride are applied, unless the export has done it."""
    raw = np.zeros((1, CELLS, 7), np.float32)
    raw[0, :, :2] = 0.5
    cell = 64 + 5  # row 1, column 1 of stride 16
    raw[0, cell] = [1.0, 1.0, np.log(20 / 16), np.log(40 / 16), 0.9, 0.1, 0.9]
    if decoded:
        raw[0, :, :2] = np.random.default_rng(0).uniform(0, 64, (CELLS, 2))
        raw[0, cell, :4] = [32, 32, 20, 40]
    path = constant_model(tmp_path / "a.onnx", [raw])
    (found,) = detect(path)
    assert found.label == "1", "no names in the file, and not COCO's number of classes"
    assert found.box == pytest.approx((22, 12, 42, 52), abs=1e-3)


def test_dynamic_shapes_take_batches_and_leave_out_padding(tmp_path: Path) -> None:
    """A model of any size gets a rectangle of the frame's form, and two frames at once."""
    detector = OnnxDetector(patchwork_model(tmp_path / "a.onnx", classes=80), size=128)
    detector.open()
    bright = Frame(Header(0, 0, "cam"), np.full((72, 128, 3), 255, np.uint8))
    dark = Frame(Header(1, 0, "cam"), np.zeros((72, 128, 3), np.uint8))
    results = detector.detect([dark, bright])
    assert [found.header.id for found in results] == [1, 0]
    white = pytest.approx((20, 8, 60, 48))  # the frame starts at row 12 of 96
    assert [any(item.box == white for item in found) for found in results] == [False, True]
    assert detector.detect([bright])[0].items == results[1].items


class _Noted(OnnxDetector):
    """Notes the sizes that it runs with."""

    def infer(self, pixels: NDArray[Any]) -> list[NDArray[Any]]:
        """Note, and run."""
        self.sizes = {*getattr(self, "sizes", ()), pixels.shape[2:]}
        return super().infer(pixels)


def test_warming_up_takes_inputs_of_a_cameras_form(tmp_path: Path) -> None:
    """What is made ready for one size, as on a GPU, is made again at the first frame of another."""
    detector = _Noted(patchwork_model(tmp_path / "a.onnx", classes=80), size=256)
    detector.open()
    assert detector.sizes == {(160, 256), (192, 256)}, "16:9 and 4:3"
    path = patchwork_model(tmp_path / "b.onnx", classes=80, shape=(1, 3, 256, 256))
    fixed = _Noted(path)
    fixed.open()
    assert fixed.sizes == {(256, 256)}


def query_boxes() -> NDArray[np.float32]:
    """Centre, width and height of 30 queries as fractions of the input; the third is a thing's."""
    boxes = np.random.default_rng(3).uniform(0.3, 0.6, (30, 4)).astype(np.float32)
    boxes[2] = [0.5, 0.5, 0.25, 0.75]
    return boxes


def with_coco_scores(form: str) -> list[NDArray[Any]]:
    """Outputs of an RT-DETR of COCO's classes, in one of its forms; query 2 is a car of 0.9."""
    scores = np.full((30, 80), 0.01, np.float32)
    scores[2, 2] = 0.9
    if form == "joined":
        return [np.hstack([query_boxes(), scores])[None]]
    if form == "ranked":
        best = np.stack([scores.max(axis=1), scores.argmax(axis=1)], axis=1)
        return [np.hstack([query_boxes(), best])[None].astype(np.float32)]
    logits = np.log(scores / (1 - scores))
    return [logits[None], query_boxes()[None]]


@pytest.mark.parametrize("form", ["joined", "ranked", "logits and boxes"])
def test_rt_detr_stretches_the_frame(tmp_path: Path, form: str) -> None:
    """Fractions of the input are fractions of the frame, whatever its aspect ratio."""
    # Without names, 84 columns would be the cells of 64 x 64 pixels.
    names = str(dict(enumerate(COCO_NAMES)))
    path = constant_model(tmp_path / "a.onnx", with_coco_scores(form), metadata={"names": names})
    (found,) = detect(path, frame(50, 200))
    assert found.label == "car"
    assert found.score == pytest.approx(0.9)
    assert found.box == pytest.approx((75, 6.25, 125, 43.75), abs=1e-3)


@pytest.mark.parametrize("classes", [2, 91])
def test_detr_is_no_rt_detr(tmp_path: Path, classes: int) -> None:
    """By a sigmoid, each of its queries for the background would be a thing of 0.99."""
    logits = np.full((100, classes + 1), -2.0, np.float32)
    logits[:, -1] = 6.0
    boxes = np.random.default_rng(3).uniform(0.3, 0.6, (100, 4)).astype(np.float32)
    path = constant_model(tmp_path / "detr.onnx", [logits[None], boxes[None]])
    with pytest.raises(ModelError, match="no object"):
        OnnxDetector(path)


def test_a_list_that_is_sure_of_the_background_is_refused(tmp_path: Path) -> None:
    """Whatever it is: a detector is not sure of most of its boxes where there is nothing."""
    boxes = np.random.default_rng(3).uniform(0.3, 0.6, (100, 4)).astype(np.float32)
    rows = np.hstack([boxes, np.full((100, 1), 0.99), np.zeros((100, 1))]).astype(np.float32)
    path = constant_model(tmp_path / "sure.onnx", [rows[None]])
    with pytest.raises(ModelError, match="hold nothing"):
        OnnxDetector(path)


def test_an_input_of_bytes_is_not_scaled(tmp_path: Path) -> None:
    """Of a model whose export has the preprocessing in it."""
    path = constant_model(
        tmp_path / "a.onnx",
        [ultralytics_output()],
        element=TensorProto.UINT8,
        metadata={"names": NAMES},
    )
    detector = OnnxDetector(path)
    pixels = detector.preprocess([Frame(Header(0, 0, "cam"), np.full((32, 64, 3), 200, np.uint8))])
    assert pixels.dtype == np.uint8
    assert set(np.unique(pixels)) == {114, 200}
