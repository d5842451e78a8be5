"""Falls are told from walking by how fast the chest goes down."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.navigation.upright import Upright


def looks(heights: list[float], rate: float, distance: float = 2.0) -> list[bool]:
    """What is said of each look."""
    upright = Upright()
    times = (round(number / rate * NANOSECONDS) for number in range(len(heights)))
    return [
        upright.keeps(height, distance, stamp) for height, stamp in zip(heights, times, strict=True)
    ]


@given(noise=st.lists(st.floats(-0.05, 0.05), min_size=2, max_size=40), rate=st.floats(5.0, 30.0))
def test_a_walker_keeps_upright_at_any_frame_rate(noise: list[float], rate: float) -> None:
    """A chest bobs and a box trembles by some centimetres."""
    assert all(looks([1.13 + error for error in noise], rate))


@pytest.mark.parametrize("rate", [5, 10, 30])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_fall_and_getting_up_are_noticed(rate: int, sign: int) -> None:
    """A metre within 0.6 s; before and after there is rest."""
    course = [min(max((step / rate - 1.0) / 0.6, 0.0), 1.0) for step in range(4 * rate)]
    found = looks([0.6 - sign * 0.5 * math.cos(math.pi * share) for share in course], rate)
    assert all(found[: rate + 1])
    assert not all(found[rate : round(1.6 * rate) + 1])
    assert all(found[2 * rate :])


def test_what_is_far_away_may_tremble_more() -> None:
    """Three degrees of pitch are a metre at 20 m."""
    heights = [1.0, 1.0, 2.0, 1.0]
    assert not all(looks(heights, 5, distance=2.0))
    assert all(looks(heights, 5, distance=20.0))
