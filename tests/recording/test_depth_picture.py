"""Depth as a grey picture tells how far all is, and what was not measured."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from aerodaas.recording.playback.page_items import depth_picture


def grey_of(depth: NDArray[np.uint16]) -> tuple[NDArray[np.int64], float]:
    """The shades, and the range in metres."""
    data, reach = depth_picture(depth)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    return np.asarray(image).astype(np.int64), reach


@given(depth=arrays(np.uint16, st.tuples(st.integers(1, 40), st.integers(1, 40))))
def test_shades_tell_how_far(depth: NDArray[np.uint16]) -> None:
    """To half a shade, up to the range; 0 for what was not measured and nothing else."""
    grey, reach = grey_of(depth)
    assert ((grey == 0) == (depth == 0)).all()
    metres, told = depth[depth > 0] / 1000, (grey[depth > 0] - 1) / 254 * reach
    assert np.abs(told - np.minimum(metres, reach)).max(initial=0.0) <= reach / 254 / 2 + 1e-4
    assert (metres > reach).sum() <= 0.011 * metres.size + 1


@pytest.mark.parametrize(("metres", "reach"), [(0, 1), (0.9, 1), (4.2, 5), (9, 10), (65.5, 70)])
def test_the_range_is_round(metres: float, reach: float) -> None:
    """So that the colours stay while a camera moves."""
    assert grey_of(np.full((9, 16), 1000 * metres, np.uint16))[1] == reach


def test_wide_depth_is_thinned_out() -> None:
    """Without mixing near and far at an edge."""
    depth = np.full((720, 1280), 1000, np.uint16)
    depth[:, 640:] = 9000
    grey, _ = grey_of(depth)
    assert grey.shape == (180, 320)
    assert set(np.unique(grey)) == {1 + round(254 * 0.1), 1 + round(254 * 0.9)}
