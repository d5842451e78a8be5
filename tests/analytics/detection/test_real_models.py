"""Real models on real frames, where the environment names a folder of them.

It holds `frames/`, pictures of one person each, and `models/`, exports of Ultralytics and of YOLOX
(by their name) of COCO's classes::

    AERODAAS_TEST_DATA=../data python -m pytest tests/analytics
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from plain_decoding import compare
from required import needs_peer, peer

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.messages.frames import Frame, Header

DATA = Path(peer("AERODAAS_TEST_DATA"))
MODELS = sorted((DATA / "models").glob("*.onnx"))

pytestmark = needs_peer("AERODAAS_TEST_DATA")


def frames() -> list[Frame]:
    """All of the folder."""
    found = [
        Frame(Header(number, 0, "folder"), np.asarray(cv2.imread(str(path)), np.uint8))
        for number, path in enumerate(sorted((DATA / "frames").glob("*.jpg")))
    ]
    assert found
    return found


@pytest.mark.parametrize("model", MODELS, ids=[model.stem for model in MODELS])
def test_a_person_is_found_in_nearly_all_frames(model: Path) -> None:
    """In 35 of 36, with the default threshold, one for all models."""
    detector = OnnxDetector(model, classes=["person"])
    detector.open()
    found = [len(detector.detect([frame])[0]) > 0 for frame in frames()]
    assert sum(found) >= 0.97 * len(found)


@pytest.mark.parametrize("model", MODELS, ids=[model.stem for model in MODELS])
def test_boxes_agree_with_the_exporters_own_post_processing(model: Path) -> None:
    """On every fourth frame."""
    detector = OnnxDetector(model, min_score=0.3, iou=0.6)
    detector.open()
    assert sum(compare(detector, model, frame) for frame in frames()[::4]) > 0
