"""Applications of the flat environment's only drone, and what is asked of it in flight."""

from __future__ import annotations

from flying import hop

from aerodaas import Environment, Odometry, Robot
from aerodaas.dataflow.graph import AeroStreamData
from aerodaas.messages.mission import MissionState

__all__ = ["drone_of", "long", "odometry_of", "short", "state_of"]


def drone_of(env: Environment) -> Robot:
    """The only drone."""
    return env.get_robot_by_id("drone")


def odometry_of(env: Environment) -> AeroStreamData[Odometry]:
    """Its odometry."""
    return drone_of(env).get_sensor_by_id("odom_drone").get_data_stream()


def short(env: Environment) -> None:
    """One waypoint."""
    drone_of(env).navigate(hop((3, 0)))


def long(env: Environment) -> None:
    """A waypoint to stay at until told otherwise."""
    drone_of(env).navigate(hop((1, 0), hover=600))


def state_of(env: Environment) -> MissionState:
    """The mission's state."""
    return env.launch().poll().robots["drone"].mission.state
