"""Navigation for a drone: waypoints and velocity commands known now, or a stream of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from aerodaas.config.extensions import service
from aerodaas.config.sections.actuators import ActuatorConfig
from aerodaas.dataflow.containers import AeroListData
from aerodaas.dataflow.graph import AeroStreamData
from aerodaas.errors import ConfigError, InvalidWaypointError
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.waypoints import (
    DEFAULT_PRIORITY,
    NavigationItem,
    NavigationType,
    SchedulingType,
    VelocityCommand,
    Waypoint,
)

__all__ = ["AeroNav", "AeroNavigation", "PriorityQueue"]


class AeroNavigation(AeroListData[NavigationItem]):
    """Navigation for a drone: a list of waypoints or commands, or a live stream of them.

    `data` is a list (waypoints known now) or a stream (`AeroStreamData`) whose items arrive in
    flight; of the latter, the list is empty and `stream` is set.
    """

    def __init__(
        self,
        navigation_type: NavigationType = NavigationType.DISTANCE_DRIVEN,
        data: Iterable[NavigationItem] | AeroStreamData[Any] = (),
        scheduling_type: SchedulingType = SchedulingType.ORDERED,
        *,
        priority: int | None = None,
    ) -> None:
        """Hold `data`; `priority`, where given, overrides that of each item.

        Raises InvalidWaypointError for an item that is neither waypoint nor velocity command,
        for two waypoints of one id, and for data in the place of the navigation's type.
        """
        if not isinstance(navigation_type, str):
            raise InvalidWaypointError(
                "AeroNavigation's first argument is its NavigationType; "
                "write AeroNavigation(data=[...])"
            )
        self.navigation_type = NavigationType(navigation_type)
        self.scheduling_type = SchedulingType(scheduling_type)
        self.priority = priority
        self.stream: AeroStreamData[AeroNavigation] | None = None
        if isinstance(data, AeroStreamData):
            self.stream = cast("AeroStreamData[AeroNavigation]", data)
            super().__init__()
            return
        super().__init__(_checked(data, priority))

    @classmethod
    def from_plan(
        cls,
        path: str | Path,
        *,
        home_altitude: float | None = None,
        ground: Callable[[float, float], float] | None = None,
        actuators: Sequence[ActuatorConfig] = (),
    ) -> AeroNavigation:
        """Read the waypoints of a ground station's plan, in order.

        Take-off and return are left out, for every mission has its own. What else the plan means
        and is not done here (pictures, gimbals, fences, …) is told by one warning.

        Args:
            path: QGroundControl's `.plan`, or Mission Planner's `.waypoints`.
            home_altitude: Metres above the sea of the environment's home, for items whose
                altitude is so; None for the plan's own. Where there is neither, their waypoints
                are `above="sea"`.
            ground: Height of the ground above the sea at a latitude and longitude, for items
                whose altitude is above ground; None makes waypoints `above="ground"`, by the
                environment's terrain.
            actuators: Those of the robot, `drone.config.actuators`: items that set a servo, relay
                or gripper of theirs become `actuate` of the waypoint before.

        Raises:
            ConfigError: If the file is no plan, or an item cannot be flown.
        """
        waypoints = service("plans.read")(path, home_altitude, ground, actuators, stacklevel=2)
        return cls(NavigationType.DISTANCE_DRIVEN, waypoints)

    def to_plan(
        self,
        path: str | Path,
        home: GeodeticOrigin,
        *,
        home_altitude: float | None = None,
        actuators: Sequence[ActuatorConfig] = (),
    ) -> None:
        """Write the waypoints as a new `.plan` or `.waypoints` file, for a ground station.

        It begins with a take-off and ends with a return. What the file cannot hold (a priority, a
        deadline; in `.waypoints` a yaw) is told by one warning.

        Args:
            path: The file, with the format as its suffix.
            home: The environment's home.
            home_altitude: Its metres above the sea, where they are known; no item needs them.
            actuators: Those of the robot, by whose instances and channels `actuate` is written.

        Raises:
            ConfigError: If there is a waypoint relative to a take-off that is not known yet, or
                one that moves another actuator; a velocity command or a stream; the suffix is
                another; or the file exists or cannot be written.
        """
        if self.stream is not None or self.commands:
            raise ConfigError("a plan holds waypoints alone, no streams and velocity commands")
        write = service("plans.write")
        write(path, self.waypoints, home, home_altitude, actuators, stacklevel=2)

    @property
    def waypoints(self) -> list[Waypoint]:
        """The waypoints among the items."""
        return [item for item in self if isinstance(item, Waypoint)]

    @property
    def commands(self) -> list[VelocityCommand]:
        """The velocity commands among the items."""
        return [item for item in self if isinstance(item, VelocityCommand)]


def _checked(data: Iterable[object], priority: int | None) -> list[NavigationItem]:
    items: list[NavigationItem] = []
    seen: set[str] = set()
    for item in data:
        if not isinstance(item, Waypoint | VelocityCommand):
            message = f"navigation takes waypoints and velocity commands, not {item!r}"
            raise InvalidWaypointError(message)
        if isinstance(item, Waypoint):
            if item.id in seen:
                message = f"two waypoints are called {item.id!r}; give each its own id"
                raise InvalidWaypointError(message)
            seen.add(item.id)
        items.append(item)
    return items if priority is None else [replace(item, priority=priority) for item in items]


AeroNav = AeroNavigation
"""The paper's name in its table."""
N = TypeVar("N")


class PriorityQueue(AeroNavigation, Generic[N]):
    """Navigation of one priority, as the paper's listings write it.

    >>> PriorityQueue(AeroListData([Waypoint("a", 1, 2, 3)]), priority=2)[0].priority
    2
    """

    def __init__(
        self,
        data: AeroNavigation | AeroListData[Waypoint] | AeroStreamData[AeroNavigation],
        priority: int = DEFAULT_PRIORITY,
    ) -> None:
        """Give every item of `data` this `priority`; smaller is more urgent."""
        if isinstance(data, AeroNavigation):
            super().__init__(
                data.navigation_type,
                data.stream if data.stream is not None else data,
                data.scheduling_type,
                priority=priority,
            )
        elif isinstance(data, AeroStreamData):
            super().__init__(NavigationType.ANALYTICS_DRIVEN, data, priority=priority)
        else:
            super().__init__(NavigationType.DISTANCE_DRIVEN, data, priority=priority)
