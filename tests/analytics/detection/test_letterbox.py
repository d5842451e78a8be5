"""Letterboxes that do not come out even: odd paddings, an own ratio for each axis, clipping."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.analytics.detection.families.base import Preprocessing
from aerodaas.analytics.detection.letterbox import Letterbox


@pytest.mark.parametrize(("centred", "left"), [(True, 11), (False, 0)])
def test_odd_padding_beside(centred: bool, left: int) -> None:  # noqa: FBT001
    """101 x 64 becomes 64 x 41; of 23 columns left over, 11 are to the left."""
    box = Letterbox((101, 64), (64, 64), Preprocessing(centred=centred))
    assert box.inner == (64, 41)
    buffer = box.buffer(1, np.float32)
    box.write(np.full((101, 64, 3), 255, np.uint8), buffer[0])
    columns = np.flatnonzero(buffer[0, 0, 0] == 1.0)
    assert (columns[0], columns[-1]) == (left, left + 40)
    assert buffer[0, 0, 0, -1] == pytest.approx(114 / 255)
    # Across 64 / 41, down 101 / 64: rounding 40.55 up to 41 stretched the one axis only.
    points = np.array([[left, 0], [left + 20.5, 32], [left + 41, 64]], np.float32)
    assert box.restore(points) == pytest.approx(np.array([[0, 0], [32, 50.5], [64, 101]]))


def test_odd_padding_above() -> None:
    """The same, lying: 11 rows above, 12 below."""
    box = Letterbox((64, 101), (64, 64), Preprocessing())
    assert (box.inner, box.top, box.left) == ((41, 64), 11, 0)
    buffer = box.buffer(1, np.float32)
    box.write(np.full((64, 101, 3), 255, np.uint8), buffer[0])
    rows = np.flatnonzero(buffer[0, 0, :, 0] == 1.0)
    assert (rows[0], rows[-1]) == (11, 51)
    assert box.restore(np.array([32, 31.5], np.float32)) == pytest.approx(np.array([50.5, 32]))


def test_points_in_the_padding_are_clipped_to_the_frame() -> None:
    """To each of its four sides, by its own length."""
    box = Letterbox((101, 64), (64, 64), Preprocessing())
    points = np.array([[0, -3], [63, 70], [-9, 90]], np.float32)
    assert box.restore(points).tolist() == [[0, 0], [64, 101], [0, 101]]


def test_flexible_inputs_keep_less_than_a_stride_of_padding() -> None:
    """41 columns need 64, 64 rows need no more; a thin strip keeps a pixel."""
    box = Letterbox((101, 64), (64, 128), Preprocessing(), flexible=True)
    assert (box.network, box.inner, box.left) == ((64, 64), (64, 41), 11)
    assert Letterbox((1, 1000), (64, 64), Preprocessing()).inner == (1, 64)


def test_channels_follow_the_family() -> None:
    """Blue 51, green 102, red 255, in the order and the range that the family wants."""
    image = np.full((8, 8, 3), (51, 102, 255), np.uint8)
    for style, expected in (
        (Preprocessing(), [1.0, 0.4, 0.2]),
        (Preprocessing(scale=1.0, rgb=False), [51, 102, 255]),
    ):
        box = Letterbox((8, 8), (8, 8), style)
        buffer = box.buffer(1, np.float32)
        box.write(image, buffer[0])
        assert buffer[0, :, 4, 4] == pytest.approx(np.array(expected))


@pytest.mark.parametrize("kind", [np.float32, np.float16])
def test_types_of_numbers(kind: type[np.float32 | np.float16]) -> None:
    """The input has the network's type, the points have 32 bits."""
    box = Letterbox((101, 64), (64, 64), Preprocessing())
    buffer = box.buffer(2, kind)
    assert (buffer.dtype, buffer.shape) == (np.dtype(kind), (2, 3, 64, 64))
    assert box.restore(np.zeros((4, 2), np.float32)).dtype == np.float32
