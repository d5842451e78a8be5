"""The real models on the real frames, against post-processing written out plainly."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import onnxruntime as ort
import pytest
from numpy.typing import NDArray

from aerodaas.analytics.onnx.detector import OnnxDetector
from aerodaas.data import Detections, Frame, Header

DATA = Path(__file__).parents[4] / "shared" / "data"
FRAMES = sorted((DATA / "frames").glob("*.jpg"))
pytestmark = pytest.mark.skipif(not FRAMES, reason=f"the real frames are not in {DATA}")
MODELS = ["yolov8n_int8.onnx", "yolo11n_int8.onnx", "yolox_nano.onnx"]
Box = tuple[int, float, float, float, float, float]
"""Class, score, left, top, right, bottom."""


def read(index: int) -> Frame:
    """One of the real frames."""
    image = cv2.imread(str(FRAMES[index]))
    return Frame(Header(index, 0, "folder"), np.asarray(image, np.uint8))


def overlap(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Intersection over union of two boxes."""
    width = max(0.0, min(a[2], b[2]) - max(a[0], b[0]))
    height = max(0.0, min(a[3], b[3]) - max(a[1], b[1]))
    areas = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1])
    return width * height / (areas - width * height)


def plain_suppression(boxes: list[Box], iou: float) -> list[Box]:
    """Greedy, one box after the other, class by class."""
    kept: list[Box] = []
    for box in sorted(boxes, key=lambda box: -box[1]):
        if all(box[0] != other[0] or overlap(box[2:], other[2:]) <= iou for other in kept):
            kept.append(box)
    return kept


def plain_ultralytics(model: Path, image: NDArray[np.uint8], least: float) -> list[Box]:
    """As ultralytics' LetterBox and non_max_suppression do it, one anchor at a time."""
    session = ort.InferenceSession(str(model), providers=["CPUExecutionProvider"])
    side = session.get_inputs()[0].shape[2]
    height, width = image.shape[:2]
    ratio = min(side / height, side / width)
    new_width, new_height = round(width * ratio), round(height * ratio)
    resized = cv2.resize(image, (new_width, new_height), interpolation=cv2.INTER_LINEAR)
    top, left = (side - new_height) / 2, (side - new_width) / 2
    padded = cv2.copyMakeBorder(
        resized,
        round(top - 0.1),
        round(top + 0.1),
        round(left - 0.1),
        round(left + 0.1),
        cv2.BORDER_CONSTANT,
        value=(114, 114, 114),
    )
    blob = padded[:, :, ::-1].transpose(2, 0, 1)[None].astype(np.float32) / 255
    output = np.asarray(session.run(None, {session.get_inputs()[0].name: blob})[0])[0]
    boxes: list[Box] = []
    for anchor in output.T:
        best = int(anchor[4:].argmax())
        score = float(anchor[4 + best])
        if score > least:
            u, v, w, h = anchor[:4].tolist()
            corners = (u - w / 2 - left, v - h / 2 - top, u + w / 2 - left, v + h / 2 - top)
            boxes.append((best, score, *clipped(corners, ratio, width, height)))
    return boxes


def plain_yolox(model: Path, image: NDArray[np.uint8], least: float) -> list[Box]:
    """As YOLOX's preproc and demo_postprocess do it, one cell at a time."""
    session = ort.InferenceSession(str(model), providers=["CPUExecutionProvider"])
    side = session.get_inputs()[0].shape[2]
    height, width = image.shape[:2]
    ratio = min(side / height, side / width)
    resized = cv2.resize(image, (int(width * ratio), int(height * ratio)))
    padded = np.full((side, side, 3), 114, np.uint8)
    padded[: resized.shape[0], : resized.shape[1]] = resized
    blob = padded.transpose(2, 0, 1)[None].astype(np.float32)
    output = np.asarray(session.run(None, {session.get_inputs()[0].name: blob})[0])[0]
    boxes: list[Box] = []
    row = 0
    for stride in (8, 16, 32):
        for y in range(side // stride):
            for x in range(side // stride):
                cell = output[row]
                row += 1
                best = int(cell[5:].argmax())
                score = float(cell[4] * cell[5 + best])
                if score > least:
                    u, v = (float(cell[0]) + x) * stride, (float(cell[1]) + y) * stride
                    w, h = np.exp(cell[2:4].astype(float)) * stride
                    corners = (u - w / 2, v - h / 2, u + w / 2, v + h / 2)
                    boxes.append((best, score, *clipped(corners, ratio, width, height)))
    return boxes


def clipped(
    corners: tuple[float, float, float, float], ratio: float, width: int, height: int
) -> tuple[float, float, float, float]:
    """Corners in the network's pixels to the frame's, within the frame."""
    left, top, right, bottom = (corner / ratio for corner in corners)
    return max(0.0, left), max(0.0, top), min(width, right), min(height, bottom)


@pytest.mark.parametrize("name", MODELS)
def test_a_person_is_found_in_all_but_one_frame(name: str) -> None:
    """With the default threshold, one for all models."""
    detector = OnnxDetector(DATA / "models" / name, classes=["person"])
    detector.open()
    found = [len(detector.detect([read(index)])[0]) > 0 for index in range(len(FRAMES))]
    assert len(found) == 36
    assert sum(found) >= 35


@pytest.mark.parametrize("name", MODELS)
def test_boxes_agree_with_the_exporters_own_post_processing(name: str) -> None:
    """IoU of at least 0.9 for each box above 0.4, of ours and of theirs, with equal labels."""
    model = DATA / "models" / name
    detector = OnnxDetector(model, min_score=0.3, iou=0.6)
    detector.open()
    plain = plain_yolox if "yolox" in name else plain_ultralytics
    for index in range(0, len(FRAMES), 4):
        frame = read(index)
        (ours,) = detector.detect([frame])
        theirs = plain_suppression(plain(model, frame.image, 0.3), 0.6)
        compare(ours, [(detector.names[box[0]], *box[1:]) for box in theirs])


def compare(ours: Detections, theirs: list[tuple[str, float, float, float, float, float]]) -> None:
    """Every box above 0.4 on either side has its like on the other."""
    strong = 0.4
    for item in ours:
        if item.score > strong:
            assert any(
                label == item.label and overlap(item.box, tuple(box)) >= 0.9
                for label, _, *box in theirs
            ), item
    for label, score, *box in theirs:
        if score > strong:
            match = next(
                item
                for item in ours
                if item.label == label and overlap(item.box, tuple(box)) >= 0.9
            )
            assert match.score == pytest.approx(score, abs=0.02)
