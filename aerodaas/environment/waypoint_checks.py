"""Check of what an application asks for at waypoints, before anything flies."""

from __future__ import annotations

from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.graph import NavigationEdge, refusal
from aerodaas.errors import GraphError
from aerodaas.mission.action_executor import action_objection

__all__ = ["require_actions"]


def require_actions(config: EnvironmentConfig, edge: NavigationEdge, line: str = "") -> None:
    """Raise GraphError for waypoints with actions that the robot cannot do.

    Args:
        config: The environment.
        edge: Navigation of one of its robots.
        line: The application's line; empty for the one that has called.
    """
    robot = next((one for one in config.robots if one.id == edge.robot), None)
    if robot is None:
        return
    for waypoint in edge.navigation.waypoints:
        if text := action_objection(waypoint, robot):
            message = f"{edge.robot}: waypoint {waypoint.id!r}: {text}"
            raise GraphError(f"{message}\n  at {line}") if line else refusal(message)
