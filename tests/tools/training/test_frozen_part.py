"""What the detector has from YOLOX is what Megvii released, and stays it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import onnx
import onnxruntime as ort
import pytest
from onnx import ModelProto, numpy_helper
from required import needs_peer, peer

from aerodaas.analytics.models import DETECTOR
from tools.training.yolox import FEATURES, OWN, SIZE, FeatureExtractor, frozen_part

RELEASED = Path(peer("AERODAAS_TEST_DATA")) / "models" / "yolox_nano.onnx"
WEIGHTS = "08ca54071011abbcbf422e054b72b105aa393dd7264546d913bedc1e217fe230"
"""SHA-256 of Megvii's weights, by name."""


def weights(model: ModelProto) -> dict[str, bytes]:
    """All that the frozen part has from Megvii."""
    added = {"rgb_to_bgr", "white"}
    return {
        tensor.name: numpy_helper.to_array(tensor).tobytes()
        for tensor in frozen_part(model).graph.initializer
        if tensor.name not in added
    }


def outputs(model: ModelProto, pixels: np.ndarray) -> list[np.ndarray]:
    """What a model's tensors are."""
    session = ort.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    found = session.run(None, {session.get_inputs()[0].name: pixels})
    return [np.asarray(tensor) for tensor in found]


def test_the_weights_are_megviis_bit_for_bit() -> None:
    """No training changes them, and no export."""
    digest = hashlib.sha256()
    for name, content in sorted(weights(onnx.load(str(DETECTOR))).items()):
        digest.update(name.encode() + content)
    assert digest.hexdigest() == WEIGHTS


@needs_peer("AERODAAS_TEST_DATA")
def test_the_shipped_part_is_cut_from_the_released_file() -> None:
    """Both give the same weights and, for RGB from 0 to 1, the same tensors."""
    shipped, released = onnx.load(str(DETECTOR)), onnx.load(str(RELEASED))
    assert weights(shipped) == weights(released)
    picture = np.random.default_rng(0).random((1, 3, *SIZE), np.float32)
    pairs = zip(
        outputs(frozen_part(shipped), picture), outputs(frozen_part(released), picture), strict=True
    )
    assert all(np.array_equal(one, other) for one, other in pairs)


@needs_peer("AERODAAS_TEST_DATA")
def test_the_picture_is_turned_into_what_yolox_was_trained_on() -> None:
    """BGR from 0 to 255: at its own size, its own head gives what the released file gives."""
    released = onnx.load(str(RELEASED))
    picture = np.zeros((1, 3, 416, 416), np.float32)
    picture[:, :, : SIZE[0]] = np.random.default_rng(1).random((1, 3, *SIZE))
    whole = outputs(released, picture[:, ::-1] * 255)[0]
    part = outputs(frozen_part(released, OWN[:1]), picture[:, :, : SIZE[0]].copy())[0]
    rows = whole[0, : 52 * 52].reshape(52, 52, -1)
    # Padding below the cut reaches the cells next to it, and by the neck, faintly, all others.
    assert np.corrcoef(rows[:16, :, 4].ravel(), part[0, 4, :16].ravel())[0, 1] > 0.9


def test_features_are_those_of_a_picture_in_opencvs_order() -> None:
    """Each of the tensors that heads see, in half precision."""
    source = onnx.load(str(DETECTOR))
    image = np.random.default_rng(2).integers(0, 256, (*SIZE, 3), dtype=np.uint8)
    rgb = image[..., ::-1].transpose(2, 0, 1)[None].astype(np.float32) / 255
    wanted = outputs(frozen_part(source, tuple(FEATURES)), rgb)
    for found, tensor, (width, stride) in zip(
        FeatureExtractor(source)(image), wanted, FEATURES.values(), strict=True
    ):
        assert found.shape == (width, SIZE[0] // stride, SIZE[1] // stride)
        assert found == pytest.approx(tensor[0], rel=2e-3, abs=2e-3)
