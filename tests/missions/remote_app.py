"""A long mission with a remote control, for the tests that kill its application."""

from __future__ import annotations

from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint
from aerodaas.analytics import RemoteAnalytics

env = Environment()
edge = env.get_compute_resource_by_id("edge")
drone = env.get_robot_by_id("drone")
odometry = drone.get_sensor_by_id("odom").get_data_stream()
remote = RemoteAnalytics(env.env_data).deploy(edge).analyse(odometry)
env.trajectory_scheduler().add_navigation(remote)
far = Waypoint("far", 400.0, 0.0, 2.0)
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [far]))
drone.start_mission()
