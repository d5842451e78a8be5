"""Distribution of waypoints over the robots of an environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from aerodaas.config.model import EnvironmentConfig
from aerodaas.errors import InvalidWaypointError
from aerodaas.geometry.energy import EnergyModel
from aerodaas.messages.waypoints import HeightDatum, Waypoint, WaypointType
from aerodaas.schedulers.trajectory.base import PlanningContext
from aerodaas.schedulers.trajectory.fleet import share_out

__all__ = ["shared_waypoints"]


def shared_waypoints(
    config: EnvironmentConfig,
    waypoints: Sequence[Waypoint],
    objective: Literal["energy", "time"],
    budget: float,
) -> dict[str, list[Waypoint]]:
    """Tours for the robots of `config`, by id, as `Environment.share_out` describes them.

    Args:
        config: Environment, whose robots start where it places them.
        waypoints: Local or global waypoints.
        objective: `energy` for the least of all robots together, `time` for the earliest last
            return.
        budget: Seconds to search for.

    Raises:
        InvalidWaypointError: For a relative waypoint, or a global one without a `home`.
        SchedulerError: Without PyVRP (on Python 3.10).
    """
    for waypoint in waypoints:
        if waypoint.waypoint_type is WaypointType.RELATIVE:
            raise InvalidWaypointError(
                f"waypoint {waypoint.id!r} is relative to a robot, and no robot has it yet: "
                'share out waypoints with waypoint_type "local" or "global"'
            )
    home, wind = config.home, np.array(config.simulation.wind, dtype=np.float64)
    origin = home.origin if home else None
    nowhere = np.zeros(3)
    # Hills between the places cost next to nothing; the robots' missions know them.
    level = HeightDatum(home.above_sea if home else None, lambda *_: 0.0)
    local = [waypoint.resolve(nowhere, origin, level) for waypoint in waypoints]
    fleet = {
        robot.id: PlanningContext(
            now=0.0,
            position=np.array(robot.start, dtype=np.float64),
            home=np.array(robot.start, dtype=np.float64),
            speed=robot.limits.cruise_speed,
            energy=EnergyModel(robot.limits.endurance, wind),
            reserve=robot.limits.battery_land,
        )
        for robot in config.robots
    }
    tours = share_out(local, fleet, objective=objective, budget=budget)
    asked = {waypoint.id: waypoint for waypoint in waypoints if waypoint.above is not None}
    return {robot: [asked.get(one.id, one) for one in tour] for robot, tour in tours.items()}
