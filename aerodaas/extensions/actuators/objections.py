"""Why actuators of a robot are not moved."""

from __future__ import annotations

from collections.abc import Sequence

from aerodaas.config.checked import near
from aerodaas.config.sections.actuators import ActuatorConfig, ParachuteConfig
from aerodaas.config.sections.robot import RobotConfig
from aerodaas.extensions.actuators.actions import MoveActuator
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import Actuate, ReleaseParachute

__all__ = ["command_objection", "waypoint_objection"]


def waypoint_objection(waypoint: Waypoint, robot: RobotConfig) -> str:
    """Why actuators are not moved at a waypoint, which has no say over a parachute.

    Args:
        waypoint: The waypoint.
        robot: The robot that carries them.

    Returns:
        One clause; empty if they can be moved.
    """
    parachutes = {one.id for one in robot.actuators if isinstance(one, ParachuteConfig)}
    for action in waypoint.actions:
        if not isinstance(action, MoveActuator):
            continue
        if action.actuator in parachutes:
            return f"{action.actuator!r} is a parachute, which no waypoint touches"
        if text := _move_objection(robot.actuators, *action.names):
            return text
    return ""


def command_objection(robot: RobotConfig, command: Actuate | ReleaseParachute) -> str:
    """Why an actuator is not moved, or a parachute not fired, by command.

    Args:
        robot: The robot that carries it.
        command: The command.

    Returns:
        One clause; empty if the environment file permits it.
    """
    if isinstance(command, Actuate):
        return _move_objection(robot.actuators, command.actuator, command.position)
    name = command.parachute
    chutes = {one.id: one for one in robot.actuators if isinstance(one, ParachuteConfig)}
    if name not in chutes:
        return f"no parachute is called {name!r}{near(name, chutes)}"
    if not chutes[name].may_release:
        return f"{name!r} may not be fired: its may_release in the environment file is false"
    return ""


def _move_objection(actuators: Sequence[ActuatorConfig], name: str, position: str) -> str:
    known = {one.id: one for one in actuators}
    actuator = known.get(name)
    if actuator is None:
        return f"no actuator is called {name!r}{near(name, known)}"
    if position not in actuator.positions:
        return f"{name!r} has no position {position!r}{near(position, actuator.positions)}"
    return ""
