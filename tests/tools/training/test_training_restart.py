"""A training that begins with an exported detector begins with what that one answers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime as ort
import pytest
import torch

from aerodaas.analytics.models import DETECTOR, POSE
from tools.training.export import SIZE, export_detector
from tools.training.network import DetectorNetwork
from tools.training.restart import learn_on_from
from tools.training.yolox import released_weights


def answer(path: Path) -> np.ndarray:
    """Boxes and scores for one picture of noise."""
    session = ort.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    pixels = np.random.default_rng(0).random((1, 3, *SIZE), np.float32)
    return np.asarray(session.run(None, {"images": pixels})[0])


def test_it_begins_where_the_export_is_and_the_mixture_lies_between(tmp_path: Path) -> None:
    """Of boxes, which no threshold shifts; kept wholly, the export comes back."""
    frozen, network = released_weights(DETECTOR), DetectorNetwork()
    pixels = torch.from_numpy(np.random.default_rng(1).random((4, 3, *SIZE), np.float32))
    learn_on_from(DETECTOR, network, frozen.features(pixels))
    boxes = answer(DETECTOR)[:, :4]
    nominal = [0.3] * 4

    def exported(kept: tuple[Path, float] | None) -> np.ndarray:
        torch.save(network.state_dict(), tmp_path / "weights.pt")
        export_detector(frozen, tmp_path / "weights.pt", tmp_path / "now.onnx", nominal, kept)
        return answer(tmp_path / "now.onnx")[:, :4]

    assert exported(None) == pytest.approx(boxes, abs=0.05)
    torch.manual_seed(0)
    for parameter in network.parameters():
        parameter.data += 0.05 * torch.randn_like(parameter)
    changed = np.abs(exported(None) - boxes).max()
    assert changed > 1.0
    assert np.abs(exported((DETECTOR, 0.9)) - boxes).max() < changed
    assert exported((DETECTOR, 1.0)) == pytest.approx(boxes, abs=0.05)


def test_another_network_is_refused() -> None:
    """Not half taken."""
    features = released_weights(DETECTOR).features(torch.zeros(1, 3, 64, 64))
    with pytest.raises(ValueError, match="convolutions, not"):
        learn_on_from(POSE, DetectorNetwork(), features)
