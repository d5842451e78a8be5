"""Falls are told from walking by how fast the chest goes down."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.following.target import Upright


def looks(heights: list[float], rate: float, distance: float = 2.0) -> list[bool]:
    """What is said of each look."""
    upright = Upright()
    times = (round(number / rate * NANOSECONDS) for number in range(len(heights)))
    return [
        upright.stands(height, distance, stamp)
        for height, stamp in zip(heights, times, strict=True)
    ]


@given(noise=st.lists(st.floats(-0.05, 0.05), min_size=2, max_size=40), rate=st.floats(5.0, 30.0))
def test_a_walker_keeps_upright_at_any_frame_rate(noise: list[float], rate: float) -> None:
    """A chest bobs and a box trembles by some centimetres."""
    assert all(looks([1.13 + error for error in noise], rate))


@pytest.mark.parametrize("rate", [5, 10, 30])
def test_who_falls_is_down_until_up_again(rate: int) -> None:
    """A metre down within 0.6 s, and up again three seconds later; before and after there is rest.

    In the middle of either motion alone it is also told, by the speed.
    """
    times = [step / rate for step in range(8 * rate)]
    fall = [min(max((time - 1.0) / 0.6, 0.0), 1.0) for time in times]
    rise = [min(max((time - 4.6) / 0.6, 0.0), 1.0) for time in times]
    down = [
        (math.cos(math.pi * up) - math.cos(math.pi * low)) / 2
        for low, up in zip(fall, rise, strict=True)
    ]
    found = looks([1.5 - height for height in down], rate)
    assert all(found[: rate + 1])
    assert not any(found[round(1.6 * rate) : round(5.0 * rate)])
    assert all(found[6 * rate :])


@pytest.mark.parametrize("rate", [5, 10, 30])
def test_who_only_gets_up_does_not_walk_meanwhile(rate: int) -> None:
    """Somebody first seen lying."""
    rise = [min(max((step / rate - 1.0) / 0.6, 0.0), 1.0) for step in range(3 * rate)]
    found = looks([0.9 - 0.6 * math.cos(math.pi * share) for share in rise], rate)
    assert not all(found[rate : round(1.6 * rate) + 1])
    assert all(found[2 * rate :])


def test_a_stoop_is_no_fall_that_lasts() -> None:
    """A fast nod of the head counts while it goes on only."""
    found = looks([1.7, 1.7, 1.7, 1.4, 1.4, 1.4], 5)
    assert found == [True, True, True, False, True, True]


def test_what_is_far_away_may_tremble_more() -> None:
    """Three degrees of pitch are a metre at 20 m."""
    heights = [1.0, 1.0, 2.0, 1.0]
    assert not all(looks(heights, 5, distance=2.0))
    assert all(looks(heights, 5, distance=20.0))
