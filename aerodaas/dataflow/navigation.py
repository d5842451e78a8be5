"""Navigation for a drone: waypoints and velocity commands known now, or a stream of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Generic, TypeVar, cast

from aerodaas.dataflow.containers import AeroListData
from aerodaas.dataflow.graph import AeroStreamData
from aerodaas.types.errors import InvalidWaypointError
from aerodaas.types.waypoints import (
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
