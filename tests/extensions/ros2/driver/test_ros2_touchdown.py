"""A landing is told by heights alone, and never by a drone that does not listen."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from aerodaas.extensions.ros2.driver.loop import Touchdown
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import FlightEnd


def came_down(
    heights: Iterable[float], ground: float = 0.0, speed: float = 0.0
) -> tuple[float, FlightEnd] | None:
    """When a landing by these heights, ten a second, was told, and how it ended."""
    touchdown = Touchdown(ground)
    for index, height in enumerate(heights):
        now = index / 10
        odometry = Odometry(np.array([1.0, 2.0, height]), np.array([0.0, 0.0, -speed]), 0.0)
        touchdown.observe(odometry, now)
        end = touchdown.end(now)
        if end is not None:
            return now, end
    return None


def descent(top: float, floor: float, then: int) -> list[float]:
    """Half a metre a second, then standing for `then` readings."""
    return [*np.arange(top, floor, -0.05), *[floor] * then]


def test_it_has_landed_once_it_stands_where_it_took_off() -> None:
    """A second later, however little its odometry trembles."""
    found = came_down(descent(2.0, 0.0, 30))
    assert found is not None
    assert found[1] is FlightEnd.LANDED
    assert 4.5 <= found[0] <= 5.5
    trembling = [height + 0.02 * (-1) ** index for index, height in enumerate([0.05] * 20)]
    assert came_down(trembling) is not None


def test_ground_elsewhere_takes_longer_to_be_believed() -> None:
    """It came down, and then it stood, for five seconds."""
    assert came_down(descent(9.0, 4.0, 45)) is None
    found = came_down(descent(9.0, 4.0, 60))
    assert found is not None
    assert found[1] is FlightEnd.LANDED


def test_a_drone_that_hovers_has_not_landed() -> None:
    """However long: it never came down, or it still comes down."""
    assert came_down([5.0] * 300) is None
    assert came_down(5.0 - 0.02 * index for index in range(200)) is None


def test_a_fall_is_no_landing() -> None:
    """By the speed at which it came down."""
    found = came_down([3.0, 2.5, 1.5, *[0.0] * 20], speed=4.0)
    assert found is not None
    assert found[1] is FlightEnd.FELL


def test_nothing_is_told_of_nothing() -> None:
    """Before the first reading."""
    assert Touchdown(0.0).end(100.0) is None
