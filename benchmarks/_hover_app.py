"""What the footprint benchmark flies: drones that hover, each above its own place."""

from __future__ import annotations

from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint

env = Environment("environment.json")
for robot in env.config.robots:
    east, north, _ = robot.start
    hover = Waypoint("there", east + 4, north, 2, hover_duration=600)
    drone = env.get_robot_by_id(robot.id)
    drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [hover]))
env.get_robot_by_id(env.config.robots[0].id).start_mission()
