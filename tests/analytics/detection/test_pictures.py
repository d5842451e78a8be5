"""Boxes on pictures of our own, against post-processing written out plainly."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from plain_decoding import compare
from synthetic_models import mosaic_model

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.models import DETECTOR
from aerodaas.messages.frames import Frame, Header

PICTURES = sorted((Path(__file__).parents[2] / "pictures").glob("*.jpg"))


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    """Rendered pictures of two shapes, and one cut to odd sides."""
    images = [np.asarray(cv2.imread(str(path)), np.uint8) for path in PICTURES]
    assert len(images) == 16
    images.append(np.ascontiguousarray(images[0][:333, :501]))
    return [Frame(Header(number, 0, "folder"), image) for number, image in enumerate(images)]


def test_ultralytics(frames: list[Frame]) -> None:
    """The detector that ships."""
    detector = OnnxDetector(DETECTOR, min_score=0.3, iou=0.6)
    detector.open()
    assert sum(compare(detector, DETECTOR, frame) for frame in frames) > 30


def test_yolox(frames: list[Frame], tmp_path: Path) -> None:
    """A network of the same outputs whose boxes follow the picture's colours, all kept."""
    model = mosaic_model(tmp_path / "yolox.onnx", 128)
    detector = OnnxDetector(model, min_score=0.3, iou=0.999)
    detector.open()
    assert sum(compare(detector, model, frame) for frame in frames[:16]) > 100
