"""Waypoints of a plan's items, and what of the plan is left out."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace

from aerodaas.config.sections.actuators import ActuatorConfig
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import ConfigError
from aerodaas.extensions.actuators.actions import MoveActuator
from aerodaas.extensions.plans.actuators import MOVES, move_of
from aerodaas.extensions.plans.commands import (
    FRAMES_ABOVE_GROUND,
    FRAMES_ABOVE_SEA,
    FRAMES_RELATIVE,
    command_name,
    why_not,
)
from aerodaas.extensions.plans.formats.numbers import LatLon, finite, place
from aerodaas.extensions.plans.pictures_in import PictureItems, same_place
from aerodaas.extensions.plans.plan import Notice, Plan, PlanItem
from aerodaas.geometry.frames import yaw_ned_to_enu
from aerodaas.messages.waypoints import HeightReference, Waypoint, WaypointType

__all__ = ["Ground", "waypoints_of"]

Ground = Callable[[float, float], float]
"""Height of the ground above the sea in metres, at a latitude and longitude in degrees."""

_FLIES_TO = {
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
    mavlink.MAV_CMD_NAV_LOITER_TIME,
}
_TAKES_OFF = {mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF}
_LANDS = {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_VTOL_LAND}
_SPEED_TYPES = (0.0, 1.0)
"""Of DO_CHANGE_SPEED: through the air, over ground; the others are those of climb and descent."""
_DEFAULT_SPEED = -2.0
_SAME_SPEED = -1.0


def waypoints_of(
    plan: Plan,
    home_altitude: float | None = None,
    ground: Ground | None = None,
    actuators: Sequence[ActuatorConfig] = (),
) -> tuple[list[Waypoint], list[Notice]]:
    """Turn a plan's items into waypoints.

    Args:
        plan: The plan.
        home_altitude: Metres above the sea of the environment's home; None for the plan's own.
        ground: Height of the ground, for items whose height is above it.
        actuators: Those of the robot, which items may move by their instance or channel.

    Returns:
        Waypoints of type `global_relative`, and what they leave out. Heights above sea and ground
        stay so where nothing here says how high those lie: the mission knows.

    Raises:
        ConfigError: If an item cannot be flown: its command leads elsewhere, its place is none, or
            its height above ground needs that of home.
    """
    if home_altitude is None and plan.home is not None:
        home_altitude = plan.home.altitude
    flown = _ReadWaypoints(plan, home_altitude, ground, actuators)
    for item in plan.items:
        flown.add(item)
    notices = [*plan.notices, *flown.notices()]
    if plan.fence:
        why = "waypoints do not hold it; `aerodaas plan fence` writes it for the environment file"
        notices.append(Notice((), "geofence", why))
    return flown.waypoints, notices


class _ReadWaypoints:
    """Waypoints up to an item, and notices by command and reason."""

    def __init__(
        self,
        plan: Plan,
        home_altitude: float | None,
        ground: Ground | None,
        actuators: Sequence[ActuatorConfig],
    ) -> None:
        self._actuators = actuators
        self.waypoints: list[Waypoint] = []
        self._ardupilot = plan.ardupilot
        self._sea = home_altitude
        self._ground = ground
        self._speed: float | None = None
        self._ended: str | None = None
        self._pictures = PictureItems(self._height, ardupilot=plan.ardupilot)
        self._said: defaultdict[tuple[str, str], list[int]] = defaultdict(list)

    def notices(self) -> list[Notice]:
        """Notices of items that were left out, in the order of first mention."""
        for item, why in self._pictures.left():
            self._say(item, why)
        return [Notice(tuple(items), name, why) for (name, why), items in self._said.items()]

    def add(self, item: PlanItem) -> None:
        """Take in the next item."""
        command = item.command
        if self._ended is not None:
            self._after_end(item, self._ended)
            return
        if not item.continues:
            self._say(item, "the drone goes on, though autoContinue is false")
        if command in _FLIES_TO:
            self._fly(item)
        elif command == mavlink.MAV_CMD_NAV_DELAY:
            self._delay(item)
        elif command in _TAKES_OFF:
            self._say(item, f"climbs to limits.takeoff_height, not to {_metres(item.z)}")
        elif command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            self._ended = command_name(command)
        elif command in _LANDS:
            self._say(item, "the drone comes back to its take-off and lands there")
            self._ended = command_name(command)
        elif command > mavlink.MAV_CMD_NAV_LAST:
            self._do(item)
        else:
            raise ConfigError(
                f"item {item.number}: {command_name(command)} cannot be flown; "
                "put waypoints in its place"
            )

    def _do(self, item: PlanItem) -> None:
        """Take in what is done on the way."""
        if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            self._change_speed(item)
        elif item.command in self._pictures.commands:
            if why := self._pictures.add_item(item, self.waypoints):
                self._say(item, why)
        elif item.command in MOVES and self._actuators:
            self._move(item)
        else:
            self._say(item, why_not(item.command))

    def _say(self, item: PlanItem, why: str) -> None:
        self._said[command_name(item.command), why].append(item.number)

    def _after_end(self, item: PlanItem, ended: str) -> None:
        if item.command in _FLIES_TO | _TAKES_OFF and ended != command_name(
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
        ):
            raise ConfigError(
                f"item {item.number}: {command_name(item.command)} stands after {ended}, and a "
                "mission lands once: make two plans of it"
            )
        self._say(item, f"stands after {ended}, which ends the flight")

    def _fly(self, item: PlanItem) -> None:
        where = f"item {item.number}"
        hover, radius, through, yaw = item.values
        here = not item.x and not item.y
        if item.command == mavlink.MAV_CMD_NAV_LOITER_TIME and here and self.waypoints:
            self._hover(item, hover or 0.0)
            return
        if here:
            raise ConfigError(f"{where}: {command_name(item.command)} has no place; give it one")
        latitude, longitude = place(item.x, item.y, where)
        height, above = self._height(item, (latitude, longitude))
        if item.command == mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT:
            self._say(item, "flown straight")
        if item.command == mavlink.MAV_CMD_NAV_WAYPOINT and (radius or through):
            self._say(item, "its radius (params 2, 3) is not used, but limits.arrival_radius")
        if item.command != mavlink.MAV_CMD_NAV_WAYPOINT or self._ardupilot:
            # Only PX4 has a heading here, and only of a waypoint.
            if item.command == mavlink.MAV_CMD_NAV_WAYPOINT and yaw:
                self._say(item, "its yaw (param 4) is not used, as ArduPilot does not turn to it")
            yaw = None
        plain = Waypoint(
            f"item{item.number}",
            latitude,
            longitude,
            height,
            hover_duration=_seconds(hover or 0.0, where),
            waypoint_type=WaypointType.GLOBAL_RELATIVE,
            yaw=None if yaw is None else yaw_ned_to_enu(math.radians(yaw)),
            speed=self._speed,
            above=above,
        )
        waypoint, refused = self._pictures.given(plain)
        self.waypoints.append(waypoint)
        for asked, why in refused:
            self._say(asked, why)

    def _height(self, item: PlanItem, at: LatLon) -> tuple[float, HeightReference | None]:
        """Metres above home, or above what follows."""
        where = f"item {item.number}"
        height = finite(item.z, f"{where}: altitude (param 7)")
        if item.frame in FRAMES_RELATIVE:
            return height, None
        if item.frame not in FRAMES_ABOVE_SEA + FRAMES_ABOVE_GROUND:
            raise ConfigError(
                f"{where}: frame {item.frame} is not known; take altitudes above home"
            )
        if item.frame in FRAMES_ABOVE_GROUND:
            if self._ground is None:
                return height, HeightReference.GROUND
            height += finite(self._ground(*at), f"{where}: height of the ground")
        if self._sea is None:
            return height, HeightReference.SEA
        return height - self._sea, None

    def _delay(self, item: PlanItem) -> None:
        seconds, *clock = item.values
        if not self.waypoints:
            self._say(item, "nothing waits before the first waypoint")
        elif (
            seconds is None or seconds < 0.0 or any(one is not None and one > 0.0 for one in clock)
        ):
            self._say(item, "nothing waits for a time of day")
        else:
            self._hover(item, seconds)

    def _hover(self, item: PlanItem, seconds: float) -> None:
        """Stay longer at the waypoint before."""
        last = self.waypoints[-1]
        longer = last.hover_duration + _seconds(seconds, f"item {item.number}")
        self.waypoints[-1] = replace(last, hover_duration=longer)

    def _move(self, item: PlanItem) -> None:
        """Move an actuator at the waypoint before."""
        move = move_of(item, self._actuators)
        if isinstance(move, str):
            self._say(item, move)
            return
        if not self.waypoints:
            self._say(item, "nothing is moved before the first waypoint")
            return
        last = self.waypoints[-1]
        action = MoveActuator(*move)
        if any(one.slot == action.slot for one in last.actions):
            # Both are done, one at a waypoint of its own in the same place.
            self.waypoints.append(same_place(last, item).with_actions(action))
        else:
            self.waypoints[-1] = last.with_actions(action)

    def _change_speed(self, item: PlanItem) -> None:
        kind, speed, throttle, relative = item.values
        kind = kind or 0.0
        if throttle is not None and throttle > 0.0:
            self._say(item, f"its throttle of {throttle:g} % is not set")
        if kind not in _SPEED_TYPES:
            self._say(item, "climb and descent keep within limits.max_climb")
        elif relative:
            self._say(item, "a speed relative to the one before is not done; that one is kept")
        elif speed == _DEFAULT_SPEED:
            self._speed = None
        elif speed is not None and speed > 0.0:
            self._speed = speed
        elif speed is not None and speed != _SAME_SPEED:
            self._say(item, f"{speed:g} m/s is no speed; the one before is kept")


def _seconds(value: float, where: str) -> float:
    if value < 0.0:
        raise ConfigError(f"{where}: cannot hold for {value:g} s; give 0 or more")
    return value


def _metres(height: float | None) -> str:
    return "the plan's height" if height is None else f"{height:g} m"
