"""What the footprint benchmark flies: drones that hover, each above its own place."""

from __future__ import annotations

from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint

env = Environment("environment.json")
drones = [env.get_robot_by_id(robot.id) for robot in env.config.robots]
for drone in drones:
    east, north, _ = drone.config.start
    hover = Waypoint("there", east + 4, north, 2, hover_duration=600)
    drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [hover]))
drones[0].start_mission()
