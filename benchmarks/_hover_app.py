"""What the footprint benchmark flies: a drone without a camera that hovers."""

from __future__ import annotations

from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
hover = Waypoint("there", 4, 0, 2, hover_duration=600)
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [hover]))
drone.start_mission()
