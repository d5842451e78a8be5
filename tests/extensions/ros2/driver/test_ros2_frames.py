"""Frames: what a drone tells and takes, against rotations by scipy's quaternions."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from ros_drone import odometry_message
from scipy.spatial.transform import Rotation

from aerodaas.extensions.ros2.driver.frames import Alignment, velocity_in
from aerodaas.extensions.ros2.topics.incoming import odometry_of
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.dynamics import KinematicState

ANGLES = st.floats(-math.pi, math.pi)
TILTS = st.floats(-1.2, 1.2)
PLACES = st.tuples(*(st.floats(-100, 100),) * 3)


@given(PLACES, PLACES, TILTS, TILTS, ANGLES)
def test_odometry_is_read_in_our_frames(
    position: tuple[float, float, float],
    velocity: tuple[float, float, float],
    roll: float,
    pitch: float,
    yaw: float,
) -> None:
    """The twist is in the body's axes, our velocity in ENU."""
    message = odometry_message(KinematicState(position, velocity, roll, pitch, yaw, 0.0), 5)
    attitude = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    turned = message.pose.pose.orientation
    spun = Rotation.from_quat([turned.x, turned.y, turned.z, turned.w])
    assert (attitude.inv() * spun).magnitude() < 1e-7
    found = odometry_of(message)
    np.testing.assert_allclose(found.position, position)
    np.testing.assert_allclose(found.velocity, velocity, atol=1e-9)
    np.testing.assert_allclose([found.roll, found.pitch], [roll, pitch], atol=1e-7)
    assert abs(math.remainder(found.yaw - yaw, math.tau)) < 1e-7


@given(PLACES, TILTS, TILTS, ANGLES, ANGLES)
def test_velocities_are_told_in_the_drones_axes(
    velocity: tuple[float, float, float], roll: float, pitch: float, yaw: float, aligned: float
) -> None:
    """The drone that turns them back by its own attitude flies as it was meant to."""
    wanted = np.array(velocity)
    odometry = Odometry(np.zeros(3), np.zeros(3), yaw, roll, pitch)
    alignment = Alignment(aligned)
    body = velocity_in("body", wanted, odometry, alignment)
    level = velocity_in("level", wanted, odometry, alignment)
    world = velocity_in("world", wanted, odometry, alignment)
    turned = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    np.testing.assert_allclose(turned.apply(body), wanted, atol=1e-9)
    np.testing.assert_allclose(Rotation.from_euler("z", yaw).apply(level), wanted, atol=1e-9)
    np.testing.assert_allclose(Rotation.from_euler("z", aligned).apply(world), wanted, atol=1e-9)


@given(PLACES, ANGLES, PLACES, ANGLES)
def test_alignment_puts_the_drone_where_it_stands(
    told: tuple[float, float, float],
    told_yaw: float,
    start: tuple[float, float, float],
    yaw: float,
) -> None:
    """And what it flies from there is turned along."""
    first = Odometry(np.array(told), np.zeros(3), told_yaw)
    alignment = Alignment.to(np.array(start), yaw, first)
    there = alignment.apply(first)
    np.testing.assert_allclose(there.position, start, atol=1e-9)
    assert abs(math.remainder(there.yaw - yaw, math.tau)) < 1e-9
    ahead = np.array([math.cos(told_yaw), math.sin(told_yaw), 0.0])
    moved = alignment.apply(Odometry(first.position + 2 * ahead, 3 * ahead, told_yaw))
    expected = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    np.testing.assert_allclose(moved.position, np.array(start) + 2 * expected, atol=1e-9)
    np.testing.assert_allclose(moved.velocity, 3 * expected, atol=1e-9)
