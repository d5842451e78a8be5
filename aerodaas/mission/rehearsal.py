"""Check of the navigation known before take-off, on a mission that never starts.

Every error that can be found without the vehicle is reported here, before anything starts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from aerodaas.config.model import EnvironmentConfig, GeofenceConfig, LimitsConfig, RobotConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import ConfigError, InvalidWaypointError
from aerodaas.geometry.energy import EnergyModel
from aerodaas.geometry.frames import Vector
from aerodaas.messages.waypoints import HeightDatum, HeightReference, Waypoint, WaypointType
from aerodaas.mission.commands import AddNavigation, Answer, Command
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.schedulers.trajectory.base import TrajectoryScheduler

__all__ = ["give", "known_ground", "rehearse"]

_ENDLESS = 1e6
"""Metres: floor and ceiling of an unbounded fence."""


def give(robot: str, commands: Iterable[Command], handle: Callable[[Command], Answer]) -> None:
    """Hand `commands` to a robot's mission.

    Args:
        robot: Id of the robot, for the error.
        commands: The commands, in order.
        handle: The mission's answer to a command.

    Raises:
        InvalidWaypointError: If the mission refuses a command; the others are not tried.
    """
    for command in commands:
        answer = handle(command)
        if not answer.accepted or answer.refused:
            raise InvalidWaypointError(
                f"{robot}: {answer.text or '; '.join(answer.refused.values())}"
            )


def rehearse(
    robot: RobotConfig,
    commands: Iterable[Command],
    environment: EnvironmentConfig,
    scheduler: TrajectoryScheduler,
) -> None:
    """Refuse navigation that the mission would refuse, or that the battery cannot cover.

    A real vehicle may stand elsewhere than the environment says: whether waypoints relative to it
    lie within the fence is checked by its node.

    Args:
        robot: The robot that would fly.
        commands: The commands before take-off, in order.
        environment: Home, terrain and simulated wind.
        scheduler: The scheduler that orders the waypoints.

    Raises:
        InvalidWaypointError: If the mission refuses a command, or the battery does not suffice.
        ConfigError: If the fence is invalid.
    """
    commands = list(commands)
    home = environment.home
    takeoff, wind = np.array(robot.start), np.array(environment.simulation.wind)
    origin = home.origin if home else None
    known = robot.driver == "simulated" or not any(map(_is_relative, commands))
    planner = InlinePlanner(scheduler)
    sea_level = home.above_sea if home else None
    clearance = known_ground(robot, environment, takeoff) if known else None
    later = {
        # What the vehicle alone knows, or lies with it, its node checks.
        HeightReference.SEA: sea_level is None and robot.driver != "simulated",
        HeightReference.GROUND: clearance is None and environment.terrain is not None,
    }
    commands = list(_without(commands, {above for above, unknown in later.items() if unknown}))
    try:
        mission = Mission(
            robot if known else _unfenced(robot),
            planner,
            takeoff=takeoff,
            origin=origin,
            wind=wind,
            clearance=clearance,
            sea_level=sea_level,
        )
    except ConfigError as error:
        raise ConfigError(f"robot {robot.id}: limits.{error}") from None
    give(robot.id, commands, lambda command: mission.handle(command, 0))
    datum = HeightDatum(sea_level, clearance.ground.height if clearance else None)
    model, limits = EnergyModel(robot.limits.endurance, wind), robot.limits
    for waypoint in _waypoints(commands):
        speed = min(waypoint.speed or limits.cruise_speed, limits.max_speed)
        place = waypoint.resolve(takeoff, origin, datum).position
        back = min(limits.cruise_speed, limits.max_speed)
        needed = model.leg(takeoff, place, speed) + model.way_home(place, takeoff, back)
        if needed > 1.0 - limits.battery_land:
            text = _too_far(needed, limits)
            raise InvalidWaypointError(f"{robot.id}: waypoint {waypoint.id!r}: {text}")


def _too_far(needed: float, limits: LimitsConfig) -> str:
    return (
        f"the way there and home takes {needed:.0%} of a full battery, and "
        f"{1.0 - limits.battery_land:.0%} is there to spend (limits: endurance "
        f"{limits.endurance:g} s, cruise_speed {limits.cruise_speed:g} m/s, battery_land "
        f"{limits.battery_land:g}): fly faster, or nearer"
    )


def _waypoints(commands: Iterable[Command]) -> Iterable[Waypoint]:
    for command in commands:
        if isinstance(command, AddNavigation):
            yield from command.navigation.waypoints


def known_ground(
    robot: RobotConfig, environment: EnvironmentConfig, takeoff: Vector
) -> GroundClearance | None:
    """The ground as the mission will know it; None where its files lie with the drone alone.

    Args:
        robot: The robot that would fly.
        environment: Home and terrain.
        takeoff: Place of the take-off, ENU metres.

    Raises:
        ConfigError: As `GroundClearance.of`.
    """
    terrain, home = environment.terrain, environment.home
    if terrain is None or home is None or not all(Path(file).exists() for file in terrain.files):
        return None
    return GroundClearance.of(environment, robot.limits, takeoff, home.above_sea)


def _without(commands: Iterable[Command], unknown: set[HeightReference]) -> Iterable[Command]:
    """The commands without waypoints whose height is above something unknown here."""
    for command in commands:
        if isinstance(command, AddNavigation) and command.navigation.waypoints:
            kept = [
                one
                for one in command.navigation
                if not (isinstance(one, Waypoint) and one.above in unknown)
            ]
            if not kept:
                continue
            if len(kept) < len(command.navigation):
                former = command.navigation
                known = AeroNavigation(former.navigation_type, kept, former.scheduling_type)
                yield replace(command, navigation=known)
                continue
        yield command


def _is_relative(command: Command) -> bool:
    return any(one.waypoint_type is WaypointType.RELATIVE for one in _waypoints([command]))


def _unfenced(robot: RobotConfig) -> RobotConfig:
    endless = GeofenceConfig(floor=-_ENDLESS, ceiling=_ENDLESS)
    limits = robot.limits.model_copy(update={"geofence": endless})
    return robot.model_copy(update={"limits": limits})
