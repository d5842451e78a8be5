"""Check of what an application asks of actuators, before anything flies."""

from __future__ import annotations

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.sections.actuators import actuator_objection
from aerodaas.dataflow.graph import NavigationEdge, refusal
from aerodaas.errors import GraphError

__all__ = ["require_actuators"]


def require_actuators(config: EnvironmentConfig, edge: NavigationEdge, line: str = "") -> None:
    """Raise GraphError for waypoints that move what the robot has not.

    Args:
        config: The environment.
        edge: Navigation of one of its robots.
        line: The application's line; empty for the one that has called.
    """
    carried = next((one.actuators for one in config.robots if one.id == edge.robot), [])
    for waypoint in edge.navigation.waypoints:
        text = actuator_objection(carried, waypoint.actions, by_waypoint=True)
        if text:
            message = f"{edge.robot}: waypoint {waypoint.id!r}: {text}"
            raise GraphError(f"{message}\n  at {line}") if line else refusal(message)
