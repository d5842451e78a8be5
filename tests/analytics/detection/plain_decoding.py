"""Post-processing as the exporters do it, written out plainly, to compare ours with."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import onnxruntime as ort
import pytest
from numpy.typing import NDArray

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.messages.frames import Frame

Box = tuple[int, float, float, float, float, float]
"""Class, score, left, top, right, bottom."""


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
    """As ultralytics' LetterBox and non_max_suppression do it, one anchor at a time.

    An input of variable size is padded to the next multiples of 32 (LetterBox's `auto`).
    """
    session = ort.InferenceSession(str(model), providers=["CPUExecutionProvider"])
    rows, columns = declared = session.get_inputs()[0].shape[2:]
    if isinstance(rows, str):
        rows, columns = json.loads(session.get_modelmeta().custom_metadata_map["imgsz"])
    height, width = image.shape[:2]
    ratio = min(rows / height, columns / width)
    new_width, new_height = round(width * ratio), round(height * ratio)
    if isinstance(declared[0], str):
        rows, columns = -(-new_height // 32) * 32, -(-new_width // 32) * 32
    resized = cv2.resize(image, (new_width, new_height), interpolation=cv2.INTER_LINEAR)
    top, left = (rows - new_height) / 2, (columns - new_width) / 2
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
            boxes.append((best, score, *(corner / ratio for corner in corners)))
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
                    boxes.append((best, score, *(corner / ratio for corner in corners)))
    return boxes


def clipped(box: Box, height: int, width: int) -> Box:
    """The box within the frame, as is done last."""
    label, score, left, top, right, bottom = box
    return label, score, max(0.0, left), max(0.0, top), min(width, right), min(height, bottom)


def compare(detector: OnnxDetector, model: Path, frame: Frame) -> int:
    """Compare the boxes of ours with those of the exporter's; returns how many were.

    Each above 0.4 on either side has its like on the other: an IoU of at least 0.9, equal labels
    and scores.
    """
    strong = 0.4
    plain = plain_yolox if "yolox" in model.name else plain_ultralytics
    boxes = plain_suppression(plain(model, frame.image, detector.min_score), detector.iou)
    within = (clipped(box, *frame.image.shape[:2]) for box in boxes)
    theirs = [
        (detector.names[box[0]], *box[1:]) for box in within if box[2] < box[4] and box[3] < box[5]
    ]
    (ours,) = detector.detect([frame])
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
    return sum(item.score > strong for item in ours)
