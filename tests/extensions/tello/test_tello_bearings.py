"""Dead reckoning axis by axis: from a Tello's own ground frame to east, north and up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aerodaas.extensions.tello.commands import BodyMotion
from aerodaas.extensions.tello.reckoning import DeadReckoning
from aerodaas.extensions.tello.state import TelloState

STILL = BodyMotion(np.zeros(3))


def packet(
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0), yaw: float = 0.0, height: float = 0.0
) -> TelloState:
    """Velocity in m/s ahead, right and down, yaw in degrees clockwise, height in metres."""
    return TelloState(0.1, 0.2, math.radians(yaw), velocity, height, 0.1, 100.0, 80, 1.0, 50.0)


def begun(yaw: float = 0.0, switched_on: float = 0.0, height: float = 0.0) -> DeadReckoning:
    """A Tello 1 m east, 2 m north and 0.5 m up at 100 s, that has just begun to fly.

    It looks `yaw` degrees against the clock from east, and calls that `switched_on` degrees.
    """
    reckoning = DeadReckoning(np.array([1.0, 2.0, 0.5]), math.radians(yaw))
    reckoning.predict(100.0, STILL)
    reckoning.correct(packet(yaw=switched_on, height=height), 100.0, standing=True)
    reckoning.correct(packet(yaw=switched_on, height=height), 100.0, standing=False)
    return reckoning


def test_before_it_is_heard_it_stands_where_the_file_says() -> None:
    """Looking where the file says, and sure of it; with a figure of its own for each reader."""
    start = np.array([1, 2, 3])
    reckoning = DeadReckoning(start, 7.0)
    odometry = reckoning.odometry
    assert odometry.position.tolist() == [1.0, 2.0, 3.0]
    assert odometry.velocity.tolist() == [0.0, 0.0, 0.0]
    assert odometry.yaw == pytest.approx(7.0 - 2 * math.pi)
    assert (odometry.roll, odometry.pitch, odometry.yaw_rate) == (0.0, 0.0, 0.0)
    assert odometry.position_sigma == reckoning.sigma == 0.0
    odometry.position[0] = odometry.velocity[0] = 99.0
    assert reckoning.odometry.position[0] == 1.0
    assert reckoning.odometry.velocity[0] == 0.0
    assert start.tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("yaw", "switched_on", "flown", "enu"),
    [
        (0.0, 0.0, (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        (0.0, 0.0, (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)),
        (0.0, 0.0, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)),
        (90.0, 0.0, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        (90.0, 0.0, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
        (90.0, 90.0, (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
        (0.0, 90.0, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        (0.0, -90.0, (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)),
    ],
)
def test_where_its_velocities_point(
    yaw: float, switched_on: float, flown: tuple[float, ...], enu: tuple[float, ...]
) -> None:
    """Ahead, right and down of where it was switched on, which is `switched_on` to its left now.

    1 m/s, less the 0.1 that a figure may be off towards the rest of before.
    """
    reckoning = begun(yaw, switched_on)
    reckoning.correct(packet(flown, switched_on), 100.0, standing=False)  # type: ignore[arg-type]
    assert reckoning.odometry.velocity == pytest.approx(0.9 * np.array(enu), abs=1e-9)


def test_a_velocity_is_cut_to_a_step_of_the_figures() -> None:
    """What is believed stays if it is within 0.1 m/s on each axis, and is moved there if not."""
    reckoning = begun()
    for figure, believed in (
        (0.3, 0.2),
        (0.3, 0.2),
        (0.2, 0.2),
        (0.1, 0.2),
        (0.0, 0.1),
        (-0.5, -0.4),
    ):
        reckoning.correct(packet((figure, 0.0, 0.0)), 100.0, standing=False)
        assert reckoning.odometry.velocity == pytest.approx([believed, 0.0, 0.0])


def test_it_turns_against_its_own_count() -> None:
    """30 degrees clockwise from a look to the north are 60 from east; within a degree."""
    reckoning = begun(90.0, 10.0)
    reckoning.correct(packet(yaw=40.0), 100.0, standing=False)
    assert math.degrees(reckoning.odometry.yaw) == pytest.approx(61.0)
    reckoning.correct(packet(yaw=41.5), 100.0, standing=False)
    assert math.degrees(reckoning.odometry.yaw) == pytest.approx(59.5)
    reckoning.correct(packet(yaw=39.0), 100.0, standing=False)
    assert math.degrees(reckoning.odometry.yaw) == pytest.approx(60.0)
    assert (reckoning.odometry.roll, reckoning.odometry.pitch) == (0.1, 0.2)


def test_a_turn_over_the_back_is_a_short_one() -> None:
    """From 179 degrees to -179 it is two degrees, not 358."""
    reckoning = begun(179.0)
    reckoning.correct(packet(yaw=-2.5), 100.0, standing=False)
    assert math.degrees(reckoning.odometry.yaw) == pytest.approx(-179.5)
    reckoning.correct(packet(yaw=-4.0), 100.0, standing=False)
    assert math.degrees(reckoning.odometry.yaw) == pytest.approx(-178.0)


@pytest.mark.parametrize("before", [0.0, -0.3, 0.7])
def test_heights_count_from_where_it_stood(before: float) -> None:
    """Whatever figure it had there; within 0.1 m, above the 0.5 m of the start."""
    reckoning = begun(height=before)
    assert reckoning.odometry.position[2] == 0.5
    for figure, height in ((1.0, 1.4), (1.05, 1.45), (0.9, 1.45), (0.5, 1.1)):
        reckoning.correct(packet(height=before + figure), 100.0, standing=False)
        assert reckoning.odometry.position == pytest.approx([1.0, 2.0, height])


def test_it_takes_up_a_velocity_with_a_lag() -> None:
    """After 0.35 s 63 % of 1 m/s, and 11 cm of way; forward, left and up of where it looks."""
    reckoning = begun(90.0)
    reckoning.predict(100.35, BodyMotion(np.array([1.0, 0.0, 0.0])))
    share = 1.0 - 1.0 / math.e
    assert reckoning.odometry.velocity == pytest.approx([0.0, share, 0.0])
    assert reckoning.odometry.position == pytest.approx([1.0, 2.0 + 0.175 * share, 0.5])
    assert reckoning.time == 100.35
    reckoning.predict(110.0, STILL)
    assert reckoning.odometry.velocity == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    reckoning = begun(90.0)
    reckoning.predict(110.0, BodyMotion(np.array([0.0, 2.0, 1.0])))
    assert reckoning.odometry.velocity == pytest.approx([-2.0, 0.0, 1.0])


def test_it_takes_up_a_turn_with_a_lag() -> None:
    """After 0.2 s 63 % of 1 rad/s against the clock; where it looks turns with it."""
    reckoning = begun()
    reckoning.predict(100.2, BodyMotion(np.zeros(3), 1.0))
    share = 1.0 - 1.0 / math.e
    assert reckoning.odometry.yaw_rate == pytest.approx(share)
    assert reckoning.odometry.yaw == pytest.approx(0.2 * share)
    reckoning.predict(100.4, STILL)
    assert reckoning.odometry.yaw_rate == pytest.approx(share / math.e)
    assert reckoning.odometry.yaw == pytest.approx(0.2 * share * (1.0 + 1.0 / math.e))


def test_on_the_ground_nothing_moves() -> None:
    """Whatever the sticks say; a landing ends every motion, on the height of the start."""
    reckoning = begun()
    ahead = BodyMotion(np.array([1.0, 0.0, 1.0]), 1.0)
    reckoning.predict(101.0, ahead)
    before = reckoning.odometry.position
    assert before[2] > 0.9
    reckoning.correct(packet((0.9, 0.0, 0.0), height=0.3), 101.0, standing=True)
    reckoning.predict(102.0, ahead)
    odometry = reckoning.odometry
    assert odometry.position == pytest.approx([before[0], before[1], 0.5])
    assert odometry.velocity.tolist() == [0.0, 0.0, 0.0]
    assert odometry.yaw_rate == 0.0
    assert reckoning.time == 102.0


def test_time_that_stands_or_goes_back_moves_nothing() -> None:
    """And the next second counts from there."""
    reckoning = begun()
    for now in (100.0, 99.0):
        reckoning.predict(now, BodyMotion(np.array([5.0, 0.0, 0.0])))
        assert reckoning.odometry.position == pytest.approx([1.0, 2.0, 0.5])
    fresh = DeadReckoning(np.zeros(3), 0.0)
    fresh.correct(packet(), 50.0, standing=False)
    fresh.predict(50.0, BodyMotion(np.array([5.0, 0.0, 0.0])))
    assert fresh.odometry.position == pytest.approx([0.0, 0.0, 0.0])
    assert fresh.sigma == 0.0


def test_hovering_for_a_minute_is_a_third_of_a_metre() -> None:
    """Twice the variance of a figure rounded to 0.1 m/s each second: 60 of 0.1² / 6 are 0.1 m²."""
    reckoning = begun()
    for tenth in range(1, 601):
        reckoning.predict(100.0 + tenth / 10, STILL)
        reckoning.correct(packet(), 100.0 + tenth / 10, standing=False)
    assert reckoning.sigma == pytest.approx(math.sqrt(0.1))


def test_of_the_way_flown_a_twentieth_is_unsure() -> None:
    """There and back alike, and upwards not: 10 m of way at 1 m/s are half a metre."""
    reckoning = begun()
    for tenth in range(1, 101):
        ahead = 1.0 if tenth <= 50 else -1.0
        reckoning.predict(100.0 + tenth / 10, BodyMotion(np.array([0.6, 0.8, 3.0]) * ahead))
        velocity = (0.6 * ahead, -0.8 * ahead, -3.0 * ahead)
        reckoning.correct(packet(velocity), 100.0 + tenth / 10, standing=False)
    walked = 10.0 * 0.1**2 / 6
    assert reckoning.sigma == pytest.approx(math.sqrt(walked + 0.5**2), rel=0.08)


@pytest.mark.parametrize(("silence", "blind"), [(0.25, 0.0), (0.375, 0.375), (1.0, 1.0)])
def test_without_packets_it_is_unsure_by_half_a_metre_a_second(
    silence: float, blind: float
) -> None:
    """From 0.3 s on, three packets: a step that ends after that counts whole."""
    reckoning = begun()
    reckoning.predict(100.0 + silence, STILL)
    walked = silence * 0.1**2 / 6
    assert reckoning.sigma == pytest.approx(math.sqrt(walked + (0.5 * blind) ** 2))
