"""Sixty metres north and back, for the test that kills the application: `--env` names the robot."""

from __future__ import annotations

from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint

env = Environment()
drone = env.get_robot_by_id("drone")
far = Waypoint("far", 0.0, 60.0, 3.0)
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [far]))
drone.start_mission()
