"""Smallest distance of a rehearsed flight from the objects of its simulated world."""

from __future__ import annotations

import math

import numpy as np

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.messages.vehicle import COLLISION
from aerodaas.protocol.proposals import ClearanceOut
from aerodaas.recording.report.flight import RecordedFlight, RobotFlight
from aerodaas.simulation.collision import BODY, Nearest, Obstacles
from aerodaas.simulation.world import World
from aerodaas.terrain.ground import Ground

__all__ = ["ON_GROUND", "clearances"]

ON_GROUND = ("", "idle", "preflight", "landed", "aborted")
"""Mission states in which a drone does not fly."""
_STAND = 1.0
"""Metres around its start in which a drone takes off and lands: what is there was there before."""


def clearances(flight: RecordedFlight, config: EnvironmentConfig) -> list[ClearanceOut]:
    """Smallest distance of each robot in the air from an object, by its true positions.

    Above its start, beside which something may stand, it does not count.

    Args:
        flight: The flight in simulation.
        config: Environment that it flew in, with the seed of its world.

    Returns:
        One for each robot that flew; none in an empty world.

    Raises:
        ConfigError: If the world or the terrain cannot be read.
    """
    obstacles = Obstacles(World.load(config.simulation))
    if not obstacles:
        return []
    found = (
        _smallest(robot, flight.robots[robot.id], config, obstacles)
        for robot in config.robots
        if robot.id in flight.robots
    )
    return [one for one in found if one is not None]


def _smallest(
    robot: RobotConfig, flown: RobotFlight, config: EnvironmentConfig, obstacles: Obstacles
) -> ClearanceOut | None:
    ground = Ground.around(robot, config)
    table = np.array(flown.truth, dtype=np.float64).reshape(-1, 4)
    aloft = ~np.isin(np.array(flown.state_at(table[:, 0])), ON_GROUND)
    aloft &= np.hypot(*(table[:, 1:3] - robot.start[:2]).T) > _STAND
    best: tuple[Nearest, tuple[float, float, float], float] | None = None
    for time, east, north, up in table[aloft].tolist():
        raised = 0.0 if ground is None else ground.height(east, north) - robot.start[2]
        point = east, north, up if math.isnan(raised) else up - raised
        least = math.inf if best is None else best[0].distance
        near = obstacles.within(point, time, least)
        if near is not None:
            best = near, (east, north, up), time
    if best is None:
        return None
    near, place, time = best
    hit = flown.bands[-1].reason.startswith(f"{COLLISION} with {near.label} {near.thing} ")
    return ClearanceOut(
        distance=0.0 if hit or near.distance < BODY else near.distance,
        thing=near.thing,
        label=near.label,
        robot=robot.id,
        place=place,
        time=time,
    )
