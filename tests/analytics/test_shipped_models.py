"""The models that ship find what they are for, in worlds that they were not trained on."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnxruntime as ort
import pytest
from required import needs_peer, peer

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.detection.vip_detection import VipDetectionAnalytics
from aerodaas.analytics.models import DETECTOR, DETECTOR_CLASSES, POSE
from aerodaas.messages.frames import Frame, Header
from tools.training.evaluate import rankings, sightings
from tools.training.rendering import HELD_OUT, render_world

PICTURES = Path(__file__).parents[1] / "pictures"
"""Rendered once, and kept: `labels.json` tells where what is."""
PHOTOGRAPHS = Path(peer("AERODAAS_TEST_DATA")) / "frames"
VESTS = Path(__file__).parent / "vests.json"
"""Where the vest is in each photograph, marked by hand: left, top, right, bottom in pixels."""
FRESH = HELD_OUT + 500
"""Seeds from here on were neither trained on nor measured with."""


@pytest.mark.parametrize("path", [DETECTOR, POSE], ids=["detector", "pose"])
def test_files_are_small_and_told_apart_by_their_metadata(path: Path) -> None:
    """The detector's as Ultralytics writes it, so that other tools read it, too."""
    assert path.stat().st_size < (6_000_000 if path == DETECTOR else 5_000_000)
    session = ort.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    metadata = session.get_modelmeta().custom_metadata_map
    assert metadata["author"] == "AeroDaaS"
    shape = session.get_outputs()[0].shape
    if path == DETECTOR:
        assert (metadata["task"], metadata["imgsz"]) == ("detect", "[256, 384]")
        assert shape == [1, 8, "boxes"]
    else:
        assert (metadata["task"], metadata["imgsz"]) == ("keypoints", "[128, 128]")
        assert shape[1:] == [17, 3]


@pytest.mark.parametrize("path", [DETECTOR, POSE], ids=["detector", "pose"])
def test_each_has_a_card_with_figures(path: Path) -> None:
    """What it was trained on, and how well it does."""
    card = path.with_suffix(".md").read_text(encoding="utf-8")
    own = ("Pictures", "mAP50") if path == DETECTOR else ("People", "OKS", "PCK@0.2")
    for row in ("Seed", "Time per", *own):
        assert f"| {row}" in card


def test_the_detector_is_the_default() -> None:
    """Of any detector, and of the vest's."""
    assert OnnxDetector().names == DETECTOR_CLASSES
    assert VipDetectionAnalytics().classes == ["vest", "person"]


@pytest.mark.parametrize(
    ("frame", "network"),
    [((720, 1280), (224, 384)), ((720, 960), (256, 352)), ((512, 512), (256, 256))],
)
def test_next_to_nothing_is_spent_on_padding(
    frame: tuple[int, int], network: tuple[int, int]
) -> None:
    """The network's input ends with the picture, but for less than 32 pixels of each axis."""
    detector = OnnxDetector()
    picture = Frame(Header(0, 0, "cam"), np.zeros((*frame, 3), np.uint8))
    assert detector.preprocess([picture]).shape == (1, 3, *network)


def test_a_model_of_ones_own_keeps_all_its_classes() -> None:
    """Only where no model is given is the vest chosen."""
    assert VipDetectionAnalytics(DETECTOR).classes is None


@pytest.mark.slow
def test_things_are_found_in_fresh_worlds() -> None:
    """Average precision at an IoU of 0.5 over sixty pictures.

    Hard ones, with many small things: vests have 0.68 in them, people 0.55.
    """
    samples = [sample for seed in range(FRESH, FRESH + 6) for sample in render_world(seed, 10)]
    precision = {
        label: ranking.average_precision for label, ranking in rankings(DETECTOR, samples).items()
    }
    assert precision["vest"] > 0.6
    assert min(precision.values()) > 0.5


def test_the_vest_is_found_in_pictures_that_are_kept(tmp_path: Path) -> None:
    """In fourteen of sixteen, with three boxes elsewhere at most."""
    labels = json.loads((PICTURES / "labels.json").read_text(encoding="utf-8"))
    vests = tmp_path / "vests.json"
    vests.write_text(json.dumps({name: things["vest"][0] for name, things in labels.items()}))
    seen = sightings(DETECTOR, PICTURES, vests, 0.3)
    assert seen.pictures == 16
    assert seen.found >= 14
    assert seen.false <= 3


@needs_peer("AERODAAS_TEST_DATA")
def test_the_vest_is_found_in_photographs() -> None:
    """In all but one, with four boxes elsewhere at most; none of them was trained on."""
    seen = sightings(DETECTOR, PHOTOGRAPHS, VESTS, 0.3)
    assert seen.found >= seen.pictures - 1
    assert seen.false <= 4
