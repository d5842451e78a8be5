"""Labels follow what happens to the picture."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tools.training.augment import augmented, placed
from tools.training.dataset import Sample


def marked(left: int, top: int, width: int, height: int) -> Sample:
    """A black picture with one white box, labelled, a keypoint in each of its upper corners."""
    image = np.zeros((120, 160, 3), np.uint8)
    image[top : top + height, left : left + width] = 255
    box = np.array([[left, top, left + width, top + height]], np.float32)
    points = np.zeros((1, 17, 3), np.float32)
    points[0, 5] = left + 1, top + 1, 2
    points[0, 6] = left + width - 2, top + 1, 2
    return Sample(image, np.array([1]), box, points)


@given(
    st.integers(0, 90),
    st.integers(0, 60),
    st.integers(20, 60),
    st.integers(20, 50),
    st.floats(0.5, 2.0),
    st.booleans(),
)
def test_the_box_moves_with_the_pixels(
    left: int,
    top: int,
    width: int,
    height: int,
    scale: float,
    mirror: bool,  # noqa: FBT001
) -> None:
    """After scaling and mirroring, the white pixels are where the label says, to two pixels."""
    across = -scale if mirror else scale
    offset = 160 * scale if mirror else 0.0
    matrix = np.array([[across, 0.0, offset], [0.0, scale, 0.0]])
    size = (round(120 * scale), round(160 * scale))
    sample = placed(marked(left, top, width, height), matrix, size, mirror=mirror)
    rows, columns = np.nonzero(sample.image[..., 0] > 200)
    drawn = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    assert sample.boxes[0] == pytest.approx(drawn, abs=2.5)
    # Of a mirrored person, the left shoulder is the one that was right: it stays on the right.
    assert (sample.keypoints[0, 5, 0] < sample.keypoints[0, 6, 0]) or width * scale < 4


def test_what_is_cut_away_has_no_label() -> None:
    """Less than a third of it in the picture: nobody could tell what it is."""
    matrix = np.array([[1.0, 0.0, -75.0], [0.0, 1.0, 0.0]])
    sample = placed(marked(40, 40, 40, 40), matrix, (120, 160))
    assert len(sample.kinds) == len(sample.boxes) == len(sample.keypoints) == 0


@settings(max_examples=30)
@given(st.integers(0, 2**32))
def test_whatever_is_drawn_the_labels_lie_in_the_picture(seed: int) -> None:
    """Mosaics as well as single pictures."""
    rng = np.random.default_rng(seed)
    sample = augmented(lambda: marked(30, 30, 70, 60), (96, 160), rng, 0.5)
    assert sample.image.shape == (96, 160, 3)
    assert sample.image.dtype == np.uint8
    assert (sample.boxes >= 0).all()
    assert (sample.boxes[:, 2:] <= (160, 96)).all()
    assert (sample.boxes[:, 2:] - sample.boxes[:, :2] >= 3.0).all()
    seen = sample.keypoints[sample.keypoints[..., 2] > 0]
    assert ((seen[:, :2] >= 0) & (seen[:, :2] < (160, 96))).all()
