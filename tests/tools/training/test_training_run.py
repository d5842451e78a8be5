"""A training of a few steps: it learns, is resumed, and what it exports is read. Needs PyTorch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.models import DETECTOR, DETECTOR_CLASSES
from aerodaas.types.data import Frame, Header
from tools.training.dataset import Pictures
from tools.training.export import Parts, export_detector, heads_of, network_in, network_of
from tools.training.features import Examples, cache_features
from tools.training.heads_train import HeadsRecipe, train_heads
from tools.training.loss import overlaps
from tools.training.metrics import overlap
from tools.training.network import DetectorNetwork, anchors_of
from tools.training.rendering import render_shards
from tools.training.train import Recipe, train
from tools.training.yolox import SIZE, FeatureExtractor

RECIPE = Recipe(steps=4, halved=2, batch=2, size=(64, 128))


HEADS = HeadsRecipe(steps=2, batch=2)


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pictures of one world, and a network and heads trained on them for a few steps."""
    folder = tmp_path_factory.mktemp("training")
    assert list(render_shards(folder / "train", 7, 1)) == [1]
    pictures = Pictures(folder / "train")
    (progress,) = train(pictures, RECIPE, folder / "run")
    extract = FeatureExtractor(onnx.load(str(DETECTOR)))
    assert list(cache_features(pictures, extract, folder / "features", 3)) == [3]
    (heads_progress,) = train_heads(Examples(folder / "features"), HEADS, folder / "heads")
    assert (progress.step, heads_progress.step) == (4, 2)
    assert np.isfinite([*progress.parts, *heads_progress.parts]).all()
    return folder


@pytest.mark.slow
def test_a_finished_training_is_not_repeated(work: Path) -> None:
    """It goes on from its checkpoint, to where nothing is left to do."""
    pictures, examples = Pictures(work / "train"), Examples(work / "features")
    assert list(train(pictures, RECIPE, work / "run")) == []
    assert list(train_heads(examples, HEADS, work / "heads")) == []


@pytest.mark.slow
def test_cached_features_are_those_of_the_labelled_pictures(work: Path) -> None:
    """Half precision, of the size that the heads see; boxes lie in the picture."""
    examples = Examples(work / "features")
    assert len(examples) == 3
    fine = examples.features(np.array([0, 2]))[1]
    assert fine.shape == (2, 64, SIZE[0] // 8, SIZE[1] // 8)
    for index in range(3):
        kinds, boxes = examples.labels(index)
        assert len(kinds) == len(boxes)
        assert (boxes >= 0).all()
        assert (boxes <= [SIZE[1], SIZE[0]] * 2).all()


@pytest.mark.slow
def test_what_is_exported_is_what_the_detector_reads(work: Path, tmp_path: Path) -> None:
    """Names and size stand in the file; YOLOX's own head scores only where it is asked to."""
    parts = Parts(
        network_of(work / "run" / "weights.pt"),
        heads_of(work / "heads" / "weights.pt"),
        onnx.load(str(DETECTOR)),
    )
    picture = np.random.default_rng(0).integers(0, 256, (*SIZE, 3), dtype=np.uint8)
    best = {}
    for released in (False, True):
        path = tmp_path / f"{released}.onnx"
        export_detector(parts, path, dict.fromkeys(DETECTOR_CLASSES, 0.3), released=released)
        detector = OnnxDetector(path)
        assert detector.names == DETECTOR_CLASSES
        assert detector.size == SIZE
        detector.open()
        frames = [Frame(Header(0, 0, "noise"), picture)]
        best[released] = detector.infer(detector.preprocess(frames))[0][0, 4:]
    learnt = 1617
    assert (best[False][:, learnt:] == 0).all()
    assert (best[True][:, learnt:].max(axis=1) > 0).tolist() == [False, True, True, False]
    assert (best[True][:, :learnt] == best[False][:, :learnt]).all()
    again = network_in(tmp_path / "True.onnx").state_dict()
    for name, tensor in parts.network.state_dict().items():
        assert torch.equal(again[name], tensor)


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
