"""A training of a few steps: it learns, is resumed, and what it exports is read. Needs PyTorch."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.models import DETECTOR, DETECTOR_CLASSES
from tools.training.dataset import Pictures
from tools.training.export import SIZE, export_detector
from tools.training.loss import overlaps
from tools.training.metrics import overlap
from tools.training.network import DetectorNetwork, anchors_of
from tools.training.rendering import render_shards
from tools.training.train import Recipe, feed, train
from tools.training.yolox import FrozenYolox, released_weights

RECIPE = Recipe(steps=4, batch=2, size=(64, 128))


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the pictures of one world and a network trained on them for four steps."""
    folder = tmp_path_factory.mktemp("training")
    assert list(render_shards(folder / "train", 7, 1)) == [1]
    pictures, frozen = Pictures(folder / "train"), released_weights(DETECTOR)
    (progress,) = train(pictures, frozen, RECIPE, folder / "run")
    assert progress.step == 4
    assert np.isfinite(progress.parts).all()
    return folder


@pytest.mark.slow
def test_a_finished_training_is_not_repeated(work: Path) -> None:
    """It goes on from its checkpoint, to where nothing is left to do."""
    frozen = released_weights(DETECTOR)
    assert list(train(Pictures(work / "train"), frozen, RECIPE, work / "run")) == []


@pytest.mark.slow
def test_what_is_exported_is_what_the_detector_reads(work: Path, tmp_path: Path) -> None:
    """Names and size stand in the file."""
    weights = work / "run" / "weights.pt"
    export_detector(released_weights(DETECTOR), weights, tmp_path / "detector.onnx", [0.3] * 4)
    detector = OnnxDetector(tmp_path / "detector.onnx")
    assert detector.names == DETECTOR_CLASSES
    assert detector.size == SIZE


def test_the_network_has_one_cell_per_anchor() -> None:
    """At each stride, for boxes and classes alike."""
    centres, strides = anchors_of((64, 96))
    features = FrozenYolox().features(torch.zeros(2, 3, 64, 96))
    outputs = DetectorNetwork().eval()(features)
    assert [tuple(output.shape[:2]) for output in outputs] == [(2, 4), (2, 4)]
    assert {output.shape[2] for output in outputs} == {centres.shape[1], strides.shape[1]}


def test_overlaps_agree_with_the_plain_ones() -> None:
    """The loss and the metric measure the same."""
    boxes = torch.tensor([[0.0, 0, 10, 10], [5, 0, 15, 10], [20, 20, 30, 31]])
    table = overlaps(boxes[:, None], boxes[None])
    plain = overlap(boxes.double().numpy(), boxes.double().numpy())
    assert table.numpy() == pytest.approx(plain, abs=1e-5)


@pytest.mark.slow
def test_a_batch_is_the_same_whoever_draws_it(work: Path) -> None:
    """In the training's own process, or by others ahead of it; also where it goes on."""
    pictures = Pictures(work / "train")
    recipe = replace(RECIPE, steps=3)
    alone = list(feed(pictures, recipe, 0))
    ahead = list(feed(pictures, replace(recipe, loaders=2), 0))
    later = list(feed(pictures, recipe, 1))
    assert len(alone) == 3
    for one, other in zip([*alone, *alone[1:]], [*ahead, *later], strict=True):
        assert all(torch.equal(a, b) for a, b in zip(one, other, strict=True))


@pytest.mark.slow
def test_several_processes_render_the_same(tmp_path: Path) -> None:
    """Shard by shard."""
    assert list(render_shards(tmp_path / "one", 40, 12)) == [10, 12]
    assert list(render_shards(tmp_path / "two", 40, 12, processes=2))[-1] == 12
    one, two = Pictures(tmp_path / "one"), Pictures(tmp_path / "two")
    assert len(one) == len(two) == 240
    for index in range(0, 240, 7):
        assert np.array_equal(one[index].image, two[index].image)
        assert np.array_equal(one[index].boxes, two[index].boxes)
