"""What the detector has from YOLOX is what Megvii released, and stays it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import onnxruntime as ort
import pytest
import torch
from required import needs_peer, peer

from aerodaas.analytics.models import DETECTOR, DETECTOR_CLASSES, POSE
from tools.training.export import SIZE, export_detector
from tools.training.network import DetectorNetwork
from tools.training.yolox import FEATURES, FrozenYolox, released_weights

RELEASED = Path(peer("AERODAAS_TEST_DATA")) / "models" / "yolox_nano.onnx"
WEIGHTS = "fd0473ad36ca5e79c0c51890e20561a58a5c47d19ce04ac4e1d89b3361aa1481"
"""SHA-256 of Megvii's weights, in the order in which they are used."""


@pytest.fixture(scope="module")
def frozen() -> FrozenYolox:
    """The shipped detector's frozen part."""
    return released_weights(DETECTOR)


def digest(network: FrozenYolox) -> str:
    """Of all weights."""
    total = hashlib.sha256()
    for value in network.state_dict().values():
        total.update(value.numpy().tobytes())
    return total.hexdigest()


def answer(path: Path, pixels: np.ndarray) -> np.ndarray:
    """What the first output of a file is."""
    session = ort.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, {session.get_inputs()[0].name: pixels})[0])


def test_the_shipped_weights_are_megviis_bit_for_bit(frozen: FrozenYolox) -> None:
    """No training changes them, and no export; nothing of them asks for a gradient."""
    assert digest(frozen) == WEIGHTS
    assert not any(parameter.requires_grad for parameter in frozen.parameters())


@needs_peer("AERODAAS_TEST_DATA")
def test_the_released_file_has_the_same_and_gives_the_same() -> None:
    """BGR from 0 to 255 there, RGB from 0 to 1 here."""
    network = released_weights(RELEASED)
    assert digest(network) == WEIGHTS
    picture = np.random.default_rng(0).random((1, 3, 416, 416), np.float32)
    theirs = answer(RELEASED, picture[:, ::-1] * 255)[0].T
    levels = network.own(network.features(torch.from_numpy(picture)))
    ours = torch.cat([level.flatten(2) for level in levels], 2)[0].numpy()
    assert ours == pytest.approx(theirs, abs=1e-3)


def test_another_networks_file_is_refused() -> None:
    """By what does not fit."""
    with pytest.raises(ValueError, match=r"pose\.onnx"):
        released_weights(POSE)


def test_features_are_those_that_are_promised(frozen: FrozenYolox) -> None:
    """Channels, and strides of 4, then twice 8, 16 and 32."""
    features = frozen.features(torch.zeros(2, 3, 64, 96))
    strides = (4, 8, 16, 32, 8, 16, 32)
    assert [tuple(part.shape) for part in features] == [
        (2, width, 64 // stride, 96 // stride)
        for width, stride in zip(FEATURES, strides, strict=True)
    ]


@pytest.mark.parametrize("size", [SIZE, (224, 384), (256, 352)])
def test_people_and_vehicles_of_its_own_head_are_listed(
    frozen: FrozenYolox, tmp_path: Path, size: tuple[int, int]
) -> None:
    """Behind what is learnt, with its own scores, cell by cell; nothing else has any.

    Pictures of any size, in the same file.
    """
    torch.manual_seed(0)
    torch.save(DetectorNetwork().state_dict(), tmp_path / "weights.pt")
    path = tmp_path / "detector.onnx"
    export_detector(frozen, tmp_path / "weights.pt", path, [0.3] * len(DETECTOR_CLASSES))
    picture = np.random.default_rng(1).random((1, 3, *size), np.float32)
    listed = answer(path, picture)[0]
    cells = listed.shape[1] // 2
    row = 0
    for stride, level in zip(
        (8, 16, 32), frozen.own(frozen.features(torch.from_numpy(picture))), strict=True
    ):
        _, _, rows, columns = level.shape
        for y, x in ((0, 0), (1, 2), (rows - 1, columns - 1)):
            u, v, wide, high, thing, *kinds = level[0, :, y, x].tolist()
            found = listed[:, cells + row + y * columns + x]
            middle = ((u + x) * stride, (v + y) * stride)
            size = (np.exp(wide) * stride, np.exp(high) * stride)
            scores = (0.0, thing * kinds[0], thing * max(kinds[2], kinds[5], kinds[7]), 0.0)
            assert found == pytest.approx([*middle, *size, *scores], rel=1e-3, abs=1e-4)
        row += rows * columns
    assert row == cells
