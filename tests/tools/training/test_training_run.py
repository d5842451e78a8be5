"""A training of a few steps: it learns, is resumed, and what it exports is read. Needs PyTorch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.models import DETECTOR_CLASSES
from tools.training.dataset import Pictures
from tools.training.export import export_detector
from tools.training.loss import overlaps
from tools.training.metrics import overlap
from tools.training.network import DetectorNetwork, anchors_of
from tools.training.rendering import render_shards
from tools.training.train import Recipe, train

RECIPE = Recipe(steps=4, halved=2, batch=2, size=(64, 128))


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the pictures of one world and a network trained on them for four steps."""
    folder = tmp_path_factory.mktemp("training")
    assert list(render_shards(folder / "train", 7, 1)) == [1]
    (progress,) = train(Pictures(folder / "train"), RECIPE, folder / "run")
    assert progress.step == 4
    assert np.isfinite(progress.parts).all()
    return folder


@pytest.mark.slow
def test_a_finished_training_is_not_repeated(work: Path) -> None:
    """It goes on from its checkpoint, to where nothing is left to do."""
    assert list(train(Pictures(work / "train"), RECIPE, work / "run")) == []


@pytest.mark.slow
def test_what_is_exported_is_what_the_detector_reads(work: Path, tmp_path: Path) -> None:
    """Names and size stand in the file."""
    weights = work / "run" / "weights.pt"
    export_detector(weights, tmp_path / "detector.onnx", [0.3] * 4)
    detector = OnnxDetector(tmp_path / "detector.onnx")
    assert detector.names == DETECTOR_CLASSES
    assert detector.size == (320, 320)


def test_the_network_has_one_cell_per_anchor() -> None:
    """At each stride, for boxes and classes alike."""
    centres, strides = anchors_of((64, 96))
    outputs = DetectorNetwork().eval()(torch.zeros(2, 3, 64, 96))
    assert [tuple(output.shape[:2]) for output in outputs] == [(2, 4), (2, 4)]
    assert {output.shape[2] for output in outputs} == {centres.shape[1], strides.shape[1]}


def test_overlaps_agree_with_the_plain_ones() -> None:
    """The loss and the metric measure the same."""
    boxes = torch.tensor([[0.0, 0, 10, 10], [5, 0, 15, 10], [20, 20, 30, 31]])
    table = overlaps(boxes[:, None], boxes[None])
    plain = overlap(boxes.double().numpy(), boxes.double().numpy())
    assert table.numpy() == pytest.approx(plain, abs=1e-5)
