"""A mission over DDS: the driver flies a drone that it knows by topics alone."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from ros_drone import RosDrone
from waiting import until

from aerodaas.clock import ScaledClock
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.extensions.ros2.driver.vehicle import Ros2Vehicle
from aerodaas.extensions.ros2.topics.link import RosLink
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import FlightEnd
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import AddNavigation, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]


def test_a_mission_to_waypoints_and_home(ros_link: RosLink, topics: str) -> None:
    """Take-off, two places with a heading, the way back and the landing, by velocities alone."""
    robot = RobotConfig.model_validate(
        {
            "id": "x3",
            "driver": "ros2",
            "limits": {"cruise_speed": 3.0, "max_speed": 3.0, "takeoff_height": 1.0},
            "settings": {
                "odometry": f"{topics}/odometry",
                "velocity": f"{topics}/cmd_vel",
                "enable": f"{topics}/enable",
                "battery": f"{topics}/battery",
                "landing_speed": 0.8,
            },
        }
    )
    vehicle = Ros2Vehicle(robot, EnvironmentConfig(robots=[robot]))
    with RosDrone(ros_link, topics, yaw=1.0) as drone:
        vehicle.connect()
        try:
            clock = ScaledClock()
            vehicle.use_clock(clock)
            until(lambda: not vehicle.preflight())
            mission = Mission(
                robot, InlinePlanner(OrderedScheduler()), takeoff=vehicle.read().odometry.position
            )
            stops = [Waypoint("a", 2, 0, 1.2), Waypoint("b", 0, 1, 1.2, yaw=math.pi / 2)]
            mission.handle(AddNavigation(AeroNavigation(data=list(stops))), clock.now())
            mission.handle(Start(), clock.now())
            loop = SetpointLoop(vehicle, mission)
            places = []
            while not mission.finished:
                loop.step(clock.now(), ())
                places.append(drone.motion.position)
                assert clock.now() < 60e9, mission.status
                time.sleep(0.05)
            assert mission.status.state is MissionState.LANDED, mission.alerts
            assert mission.status.visited == ("a", "b")
            for stop in stops:
                distances = np.linalg.norm(np.array(places) - [stop.x, stop.y, stop.z], axis=1)
                assert distances.min() < 0.4, stop
            assert np.linalg.norm(drone.motion.position) < 0.5
            assert vehicle.read().ended is FlightEnd.LANDED
            until(lambda: drone.switched and not drone.switched[-1])
            assert drone.switched[0], "the motors went on before they went off"
            assert vehicle.read().battery.fraction == pytest.approx(0.8)
        finally:
            vehicle.close()
