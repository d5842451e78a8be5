"""Several detectors as one: each finds its own labels, and nothing is found twice."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from aerodaas.analytics.detection.combined import CombinedDetector
from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.detection.vip_detection import VipDetectionAnalytics
from aerodaas.analytics.models import DETECTOR_CLASSES
from aerodaas.errors import ConfigError, ModelError
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Frame, Header

PICTURES = sorted((Path(__file__).parents[2] / "pictures").glob("*.jpg"))


def frames() -> list[Frame]:
    """Rendered pictures of people, vests, cars and towers; one with measured depth."""
    found = []
    for number, path in enumerate(PICTURES):
        image = np.asarray(cv2.imread(str(path)), dtype=np.uint8)
        depth = np.full(image.shape[:2], 4000, np.uint16) if number == 0 else None
        found.append(Frame(Header(number, number, "drone/cam"), image, depth=depth))
    return found


def shown(found: Detections) -> list[tuple[str, float, tuple[float, ...], float | None]]:
    """What is compared of each box."""
    return [(one.label, one.score, tuple(one.box), one.depth) for one in found]


def test_it_finds_what_one_detector_of_all_labels_finds() -> None:
    """By the same network, each box once, best first, with what is known of the frame."""
    whole = OnnxDetector(threads=1)
    shares = (["vest", "tower"], ["person"], ["car"])
    parts = CombinedDetector([OnnxDetector(classes=share, threads=1) for share in shares])
    whole.open()
    parts.open()
    seen = set()
    for frame in frames():
        (wanted,), found = whole.detect([frame]), parts.process(frame, None)  # type: ignore[arg-type]
        assert shown(found) == shown(wanted)
        assert (found.header, found.width, found.height) == (
            frame.header,
            frame.width,
            frame.height,
        )
        assert (found.nearest is None) == (frame.depth is None)
        seen |= {one.label for one in found}
    assert len(seen) >= 2
    parts.close()
    with pytest.raises(ModelError, match="open"):
        parts.process(frames()[0], None)  # type: ignore[arg-type]


def test_each_label_has_one_finder() -> None:
    """Two would count somebody twice; the model's own order names the label."""
    with pytest.raises(ConfigError, match="would find person: give each detector its classes="):
        CombinedDetector([VipDetectionAnalytics(), OnnxDetector(classes=["car", "person"])])
    with pytest.raises(ConfigError, match="would find vest"):
        CombinedDetector([OnnxDetector(), OnnxDetector()])
    apart = [VipDetectionAnalytics(classes=["vest"]), OnnxDetector(classes=["person"])]
    assert [one.labels for one in CombinedDetector(apart).detectors] == [("vest",), ("person",)]
    assert OnnxDetector().labels == DETECTOR_CLASSES


def test_what_is_no_detector_is_refused() -> None:
    """Where it is said."""
    with pytest.raises(ConfigError, match="at least one"):
        CombinedDetector([])
    with pytest.raises(ConfigError, match="not str: 'yolox-nano'"):
        CombinedDetector(["yolox-nano"])  # type: ignore[list-item]
