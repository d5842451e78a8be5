"""The driver and a drone on topics, over DDS on loopback."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from ros_drone import RosDrone
from waiting import until

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.loading import load_vehicle
from aerodaas.errors import ConfigError, InvalidWaypointError, VehicleError
from aerodaas.extensions.ros2.driver import vehicle as module
from aerodaas.extensions.ros2.driver.vehicle import Ros2Vehicle
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.link import RosLink
from aerodaas.messages.vehicle import (
    ClockedVehicle,
    FlightEnd,
    PositionSetpoint,
    Vehicle,
    VehicleMode,
    VelocitySetpoint,
)

pytestmark = pytest.mark.wall_clock


def robot_of(topics: str, **settings: Any) -> RobotConfig:  # noqa: ANN401
    """A robot of the topics under `topics`."""
    return RobotConfig.model_validate(
        {
            "id": "x3",
            "driver": "ros2",
            "start": settings.pop("start", (0, 0, 0)),
            "limits": {"max_speed": 3.0, "max_climb": 2.0, "cruise_speed": 2.0},
            "settings": {
                "odometry": f"{topics}/odometry",
                "velocity": f"{topics}/cmd_vel",
                "enable": f"{topics}/enable",
                "landing_speed": 1.0,
                **settings,
            },
        }
    )


@contextmanager
def connected(topics: str, **settings: Any) -> Iterator[Ros2Vehicle]:  # noqa: ANN401
    """A driver that has found the drone, and the drone it."""
    robot = robot_of(topics, **settings)
    vehicle = load_vehicle(robot, EnvironmentConfig(robots=[robot]))
    assert isinstance(vehicle, Ros2Vehicle)
    vehicle.connect()
    try:
        yield vehicle
    finally:
        vehicle.close()


@contextmanager
def hovering(
    ros_link: RosLink,
    topics: str,
    **settings: Any,  # noqa: ANN401
) -> Iterator[tuple[RosDrone, Ros2Vehicle]]:
    """A drone a metre up."""
    with RosDrone(ros_link, topics) as drone, connected(topics, **settings) as vehicle:
        until(lambda: not vehicle.preflight())
        vehicle.take_off(1.0)
        until(lambda: vehicle.read().mode is VehicleMode.HOLDING)
        yield drone, vehicle


def speed(velocity: Any) -> float:  # noqa: ANN401
    """m/s."""
    return math.hypot(velocity.x, velocity.y, velocity.z)


def test_it_rises_obeys_holds_and_lands(ros_link: RosLink, topics: str) -> None:
    """Each by what the drone itself does."""
    with hovering(ros_link, topics) as (drone, vehicle):
        assert isinstance(vehicle, Vehicle)
        assert isinstance(vehicle, ClockedVehicle)
        assert drone.enabled
        assert drone.motion.position[2] == pytest.approx(1.0, abs=0.3)

        sent = vehicle.send(VelocitySetpoint(np.array([30.0, 40.0, 9.0]), 99.0))
        assert isinstance(sent, VelocitySetpoint)
        np.testing.assert_allclose(sent.velocity, [1.8, 2.4, 2.0])
        assert sent.yaw_rate == pytest.approx(math.radians(90))

        assert vehicle.read().mode is VehicleMode.GUIDED
        # Nobody sends any more: it stops by itself, and stays.
        until(lambda: vehicle.read().mode is VehicleMode.HOLDING)
        vehicle.land()
        assert vehicle.read().mode is VehicleMode.LANDING
        with pytest.raises(VehicleError, match="follow a setpoint while it is landing"):
            vehicle.send(sent)
        until(lambda: vehicle.read().mode is VehicleMode.GROUNDED)
        state = vehicle.read()
        assert (state.ended, state.armed) == (FlightEnd.LANDED, False)
        until(lambda: not drone.enabled)
        assert drone.motion.position[2] == 0.0


def test_without_odometry_it_stands_still_and_is_lost(ros_link: RosLink, topics: str) -> None:
    """However long setpoints go on; with odometry it is back."""
    with hovering(ros_link, topics) as (drone, vehicle):
        ahead = VelocitySetpoint(np.array([1.0, 0.0, 0.0]))

        def pushed() -> bool:
            vehicle.send(ahead)
            time.sleep(0.05)
            return speed(drone.velocity) > 0.5

        until(pushed)
        drone.silent = True

        def lost() -> bool:
            vehicle.send(ahead)
            time.sleep(0.05)
            return vehicle.read().mode is VehicleMode.LOST

        until(lost)
        assert speed(drone.velocity) == 0.0
        assert any("no odometry on" in one for one in vehicle.read().faults)
        vehicle.land()
        until(lambda: drone.velocity.z == pytest.approx(-1.0))
        drone.silent = False
        until(lambda: vehicle.read().mode is VehicleMode.GROUNDED)


def test_odometry_of_nan_is_none(ros_link: RosLink, topics: str) -> None:
    """It is refused, told, and the drone lost as without any; nor are setpoints of it."""
    with RosDrone(ros_link, topics) as drone, connected(topics) as vehicle:
        drone.spoiled = True
        until(lambda: vehicle.read().mode is VehicleMode.LOST)
        state = vehicle.read()
        assert any("odometry refused" in one for one in state.faults)
        assert state.extra["refused_messages"] > 0
        assert np.isfinite(state.odometry.position).all()
        for wrong in (
            VelocitySetpoint(np.array([math.nan, 0.0, 0.0])),
            VelocitySetpoint(np.zeros(3), math.inf),
            PositionSetpoint(np.array([0.0, 0.0, math.inf])),
        ):
            with pytest.raises(InvalidWaypointError):
                vehicle.send(wrong)
        assert not drone.heard


def test_letting_go_in_the_air_stops_it(ros_link: RosLink, topics: str) -> None:
    """Its last word is zero."""
    with hovering(ros_link, topics) as (drone, vehicle):
        vehicle.send(VelocitySetpoint(np.array([2.0, 0.0, 0.0])))
        until(lambda: speed(drone.velocity) > 0.5)
        vehicle.close()
        until(lambda: speed(drone.velocity) == 0.0)
        heard = len(drone.heard)
        time.sleep(0.2)
        assert len(drone.heard) == heard
        with pytest.raises(VehicleError, match="not connected"):
            vehicle.read()
        vehicle.connect()
        assert vehicle.read().mode is VehicleMode.HOLDING, "found in the air"
        assert any("already holding" in one for one in vehicle.preflight())


def test_what_speaks_against_a_take_off_is_told(ros_link: RosLink, topics: str) -> None:
    """The battery, and a drone that does not listen."""
    with (
        RosDrone(ros_link, topics) as drone,
        connected(topics, battery=f"{topics}/battery", velocity="/nobody") as vehicle,
    ):
        drone.charge = 0.1
        until(lambda: "nobody subscribes to /nobody" in vehicle.preflight())
        until(lambda: "the battery holds 10%, take-off needs 20%" in vehicle.preflight())
        with pytest.raises(VehicleError, match="refuses to take off: nobody subscribes"):
            vehicle.take_off(1.0)
        for height in (math.nan, 0.0, -1.0):
            with pytest.raises(InvalidWaypointError):
                vehicle.take_off(height)
        with pytest.raises(VehicleError, match="cannot hold on the ground"):
            vehicle.hold()
        vehicle.land()
        assert vehicle.read().mode is VehicleMode.GROUNDED


def test_looking_publishes_nothing(ros_link: RosLink, topics: str) -> None:
    """As `aerodaas check` does."""
    robot = robot_of(topics)
    environment = EnvironmentConfig(robots=[robot])
    vehicle = load_vehicle(robot, environment, observing=True)
    with RosDrone(ros_link, topics):
        vehicle.connect()
        assert f"{topics}/cmd_vel" not in ros_link.published()
        assert vehicle.read().mode is VehicleMode.GROUNDED
        with pytest.raises(VehicleError, match="only looked at"):
            vehicle.take_off(1.0)
        vehicle.close()


def test_odometry_that_begins_anywhere_is_aligned(ros_link: RosLink, topics: str) -> None:
    """To the start of the environment file; velocities in its own frame are turned back."""
    settings = {"align_to_start": True, "velocity_frame": "world", "start": (5, 6, 7)}
    with (
        RosDrone(ros_link, topics, start=(100.0, -50.0, 3.0), yaw=math.pi / 2) as drone,
        connected(topics, **settings) as vehicle,
    ):
        state = vehicle.read()
        np.testing.assert_allclose(state.odometry.position, [5, 6, 7], atol=0.01)
        assert state.odometry.yaw == pytest.approx(0.0, abs=0.01)
        until(lambda: not vehicle.preflight())
        vehicle.take_off(2.0)
        until(lambda: len(drone.heard) > 0)
        vehicle.close()


def test_a_twist_can_be_stamped(ros_link: RosLink, topics: str) -> None:
    """With the frame that it is in, by the odometry's own names."""
    heard: list[Any] = []
    ros_link.subscribe(f"{topics}/setpoint", types.TWIST_STAMPED, heard.append)
    settings = {"velocity": f"{topics}/setpoint", "velocity_type": "twist_stamped"}
    with (
        RosDrone(ros_link, topics),
        connected(topics, velocity_frame="world", **settings) as vehicle,
    ):
        until(lambda: not vehicle.preflight())
        vehicle.take_off(1.0)
        until(lambda: heard)
    assert heard[0].header.frame_id == "x3/odom"
    assert abs(heard[0].header.stamp.sec - time.time()) < 60
    assert heard[0].twist.linear.z > 0


def test_a_missing_topic_is_told(ros_link: RosLink, topics: str) -> None:
    """With those that there are."""
    robot = robot_of(topics, odometry="/no/odometry")
    vehicle = module.Ros2Vehicle(robot, EnvironmentConfig(robots=[robot]))
    with RosDrone(ros_link, topics):
        there = rf"no odometry on /no/odometry .*odometry is on {topics}/odometry"
        with pytest.raises(VehicleError, match=there):
            vehicle.connect(timeout=0.8)


def test_settings_are_checked() -> None:
    """Topics are needed, and need to be names."""
    for wrong in ({"odometry": "/a b"}, {"velocity_frame": "ned"}, {"domain": 233}, {"speed": 1}):
        robot = robot_of("/x", **wrong)
        with pytest.raises(ConfigError, match="robot x3: settings"):
            module.Ros2Vehicle(robot, EnvironmentConfig(robots=[robot]))
