"""RTMPose: joints are found where they are in the frame, whatever the box's shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from synthetic_models import constant_model, simcc_model

from aerodaas.analytics.detection.keypoints import KeypointModel, SimccHead
from aerodaas.analytics.people.pose import PoseAnalytics
from aerodaas.errors import ModelError


@pytest.mark.parametrize(
    "box", [(100, 40, 180, 340), (60, 150, 360, 260), (-50, -20, 90, 400), (120, 190, 150, 230)]
)
def test_a_light_is_found_where_it_is(tmp_path: Path, box: tuple[float, ...]) -> None:
    """Upright, lying, cut off by the frame's edge, and smaller than the crop."""
    left, top, right, bottom = box
    u, v = round(left + 0.7 * (right - left)), round(top + 0.4 * (bottom - top))
    image = np.zeros((480, 640, 3), np.uint8)
    spread = max(1, round((bottom - top) / 40))
    image[v - spread : v + spread, u - spread : u + spread] = 255
    network = KeypointModel(simcc_model(tmp_path / "a.onnx"), threads=1)
    network.open()
    region = network.head.region((left, top, right, bottom))
    pixel = region[2] / network.head.size[0]
    (found,) = network.find(image, [(left, top, right, bottom)])
    assert found.shape == (17, 3)
    assert found[:, 0] == pytest.approx(u, abs=pixel)
    assert found[:, 1] == pytest.approx(v, abs=pixel)
    assert ((found[:, 2] >= 0) & (found[:, 2] <= 1)).all()


def test_the_crop_holds_the_box_with_a_margin() -> None:
    """A quarter more than the box, in the shape of the network's input."""
    head = SimccHead((192, 256), 2)
    assert head.region((100, 100, 200, 400)) == pytest.approx((9.375, 62.5, 281.25, 375))
    assert head.region((100, 100, 500, 200)) == pytest.approx(
        (50, -183.333, 500, 666.667), abs=0.01
    )


def test_colours_are_normalised_as_in_training() -> None:
    """The mean colour, red first, is zero."""
    cut = np.array([124, 116, 104], np.uint8).reshape(1, 1, 1, 3)
    assert SimccHead((192, 256), 2).normalise(cut) == pytest.approx(0, abs=0.01)


def test_both_kinds_make_a_pose_analysis(tmp_path: Path) -> None:
    """In the place of the network that ships."""
    pose = PoseAnalytics(simcc_model(tmp_path / "a.onnx"))
    assert isinstance(pose.keypoints.head, SimccHead)


@pytest.mark.parametrize(
    "shapes",
    [
        ((1, 17, 96), (1, 17, 100)),
        ((1, 13, 96), (1, 13, 128)),
        ((), (1, 17, 128)),
        ((1, 17, 96), (1, 17, 128), (1, 17, 128)),
    ],
)
def test_other_distributions_are_refused(
    tmp_path: Path, shapes: tuple[tuple[int, ...], ...]
) -> None:
    """Bins that fit no crop, other skeletons, a number without axes, and a third output."""
    outputs = [np.zeros(shape, np.float32) for shape in shapes]
    path = constant_model(tmp_path / "a.onnx", outputs, shape=("b", 3, 64, 48))
    with pytest.raises(ModelError, match="finds no keypoints"):
        KeypointModel(path)
