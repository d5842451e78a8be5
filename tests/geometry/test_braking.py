"""Braking distances and velocities towards a place, by hand: metres, seconds, radians."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aerodaas.geometry.braking import braking_speed, limit_length, stopping_point, velocity_towards
from aerodaas.geometry.frames import Vector
from aerodaas.messages.vehicle import PositionSetpoint, VelocitySetpoint


@pytest.mark.parametrize(
    ("distance", "deceleration", "reaction", "speed"),
    [
        (4.0, 2.0, 0.0, 4.0),
        (6.0, 2.0, 0.5, 4.0),
        (1.5, 2.0, 0.25, 2.0),
        (0.0, 2.0, 0.5, 0.0),
        (-1.0, 2.0, 0.5, 0.0),
    ],
)
def test_a_drone_stops_within_what_is_left(
    distance: float, deceleration: float, reaction: float, speed: float
) -> None:
    """4 m/s flown on for 0.5 s are 2 m, and braked by 2 m/s² 4 m more."""
    assert braking_speed(distance, deceleration, reaction) == pytest.approx(speed)


def test_a_drone_comes_to_rest_ahead() -> None:
    """5 m/s, braked by 2.5 m/s², need 5 m, along the way it flies."""
    rest = stopping_point(np.array([1.0, 1.0, 1.0]), np.array([3.0, 4.0, 0.0]), 2.5)
    assert rest == pytest.approx([4.0, 5.0, 1.0])
    still = stopping_point(np.array([1.0, 1.0, 1.0]), np.zeros(3), 2.5)
    assert still == pytest.approx([1.0, 1.0, 1.0])


def test_a_vector_is_shortened_and_never_lengthened() -> None:
    """3, 4 is 5 long."""
    assert limit_length(np.array([3.0, 4.0, 0.0]), 2.5) == pytest.approx([1.5, 2.0, 0.0])
    assert limit_length(np.array([3.0, 4.0, 0.0]), 5.0) == pytest.approx([3.0, 4.0, 0.0])
    assert limit_length(np.zeros(3), 0.0) == pytest.approx([0.0, 0.0, 0.0])


def towards(
    place: tuple[float, float, float],
    *,
    asked: float | None = None,
    look: float | None = None,
    yaw: float = 0.0,
) -> VelocitySetpoint:
    """From (1, 1, 1) at up to 3 m/s, braking by 2 m/s² at once, turning at up to 0.6 rad/s."""
    here: Vector = np.array([1.0, 1.0, 1.0])
    setpoint = PositionSetpoint(np.array(place), look, asked)
    return velocity_towards(
        setpoint, here, yaw, speed=3.0, deceleration=2.0, reaction_time=0.0, yaw_rate=0.6
    )


def test_far_off_a_place_is_flown_to_at_full_speed() -> None:
    """3 m/s, or its own 1 m/s, straight there."""
    assert towards((31.0, 41.0, 1.0)).velocity == pytest.approx([1.8, 2.4, 0.0])
    assert towards((31.0, 41.0, 1.0), asked=1.0).velocity == pytest.approx([0.6, 0.8, 0.0])


@pytest.mark.parametrize(("distance", "speed"), [(1.0, 2.0), (0.25, 1.0), (0.01, 0.2), (0.0, 0.0)])
def test_near_a_place_the_drone_can_still_stop_there(distance: float, speed: float) -> None:
    """The square root of twice the deceleration times the way, up or along."""
    assert towards((1.0, 1.0, 1.0 - distance)).velocity == pytest.approx([0.0, 0.0, -speed])
    assert towards((1.0 + distance, 1.0, 1.0)).velocity == pytest.approx([speed, 0.0, 0.0])


@pytest.mark.parametrize(
    ("look", "yaw", "rate"),
    [
        (None, 1.0, 0.0),
        (0.2, 0.0, 0.3),
        (0.0, 0.2, -0.3),
        (2.0, 0.0, 0.6),
        (-2.0, 0.0, -0.6),
        (math.pi - 0.1, -math.pi + 0.1, -0.3),
    ],
)
def test_a_yaw_is_turned_to_by_the_shorter_way(look: float | None, yaw: float, rate: float) -> None:
    """1.5 times the angle in a second, at most 0.6; without one the drone keeps looking."""
    assert towards((1.0, 1.0, 1.0), look=look, yaw=yaw).yaw_rate == pytest.approx(rate)
