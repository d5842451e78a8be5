"""What a depth picture tells of a box, holes and all."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.errors import SourceError
from aerodaas.geometry.depth import depth_in_box, nearest_in_cells
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame, Header

EDGES = st.floats(-2000, 2000, allow_nan=False) | st.sampled_from([math.nan, math.inf, -math.inf])
BOX = (20.0, 10.0, 60.0, 50.0)


def picture(background: int = 9000) -> np.ndarray:
    """60 x 80 pixels of background, with a body 2.5 m away in the middle of `BOX`."""
    depth = np.full((60, 80), background, np.uint16)
    depth[15:45, 28:52] = 2500
    return depth


def test_a_box_is_as_far_as_what_is_in_its_middle() -> None:
    """Not as what shows beside a body, nor as a few pixels that were measured wrong."""
    depth = picture()
    assert depth_in_box(depth, BOX) == 2.5
    depth[30:33, 30:50] = 300
    depth[20:24, 30:50] = 0
    assert depth_in_box(depth, BOX) == 2.5


def test_what_was_not_measured_has_no_depth() -> None:
    """Out of range, most of it holes, or out of the picture."""
    assert depth_in_box(np.zeros((60, 80), np.uint16), BOX) is None
    holes = picture()
    holes[:, ::4] = 0
    assert depth_in_box(holes, BOX) == 2.5
    holes[:, 1::4] = holes[:, 2::4] = 0
    assert depth_in_box(holes, BOX) is None
    assert depth_in_box(picture(), (100.0, 10.0, 140.0, 50.0)) is None


@given(st.tuples(EDGES, EDGES, EDGES, EDGES))
def test_no_box_breaks_it(box: tuple[float, float, float, float]) -> None:
    """Whatever a model gives: a depth that is in the picture, or none."""
    assert depth_in_box(picture(), box) in (None, 2.5, 9.0, 5.75)


def test_boxes_of_a_frame_with_depth_have_theirs() -> None:
    """Those of one without have none."""
    image = np.zeros((60, 80, 3), np.uint8)
    items = [Detection(BOX, "person", 0.5), Detection((0, 0, 10, 10), "car", 0.9)]
    found = Detections.of(Frame(Header(0, 0, "cam"), image, depth=picture()), items)
    assert [(one.label, one.depth) for one in found] == [("car", 9.0), ("person", 2.5)]
    assert [one.depth for one in Detections.of(Frame(Header(0, 0, "cam"), image), items)] == [
        None,
        None,
    ]


@pytest.mark.parametrize(
    "depth", [np.zeros((60, 81), np.uint16), np.zeros((60, 80)), np.zeros((60, 80, 1), np.uint16)]
)
def test_a_depth_that_is_not_the_pictures_is_refused(depth: np.ndarray) -> None:
    """By size and by type, saying what is wanted."""
    with pytest.raises(SourceError, match="cam: depth must be height x width of uint16"):
        Frame(Header(0, 0, "cam"), np.zeros((60, 80, 3), np.uint8), depth=depth)


@given(
    rows=st.integers(1, 100),
    columns=st.integers(1, 100),
    background=st.integers(0, 2**16 - 1),
)
def test_coarse_depth_of_an_even_picture_is_the_same(
    rows: int, columns: int, background: int
) -> None:
    """Of any size, with no more cells than pixels."""
    coarse = nearest_in_cells(np.full((rows, columns), background, np.uint16))
    assert coarse.shape == (min(18, rows), min(32, columns))
    assert (coarse == background).all()


def test_the_nearest_in_a_cell_counts_unless_it_is_speckle() -> None:
    """A post of a fifth of the cell, before a background or before nothing."""
    for background in (0, 9000):
        depth = np.full((360, 640), background, np.uint16)
        depth[40:60, 80:84] = 1500
        depth[0, 0] = 200
        coarse = nearest_in_cells(depth)
        assert coarse[2, 4] == 1500
        assert (np.delete(coarse.ravel(), 2 * 32 + 4) == background).all()
