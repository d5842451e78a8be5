"""The mission that an emulated autopilot flies by itself: its way home."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.geometry import Vector
from tools.mavlink_vehicle.flight import GuidedTarget, MavFlight

__all__ = ["Route"]

_NEAR = 1.0
"""Metres within which a waypoint is reached."""
_EARTH = 1e7


class Route:
    """Flies the items of a mission one after the other, once it has been joined."""

    def __init__(
        self,
        flight: MavFlight,
        items: Callable[[], list[Any]],
        home: Callable[[], Vector],
        say: Callable[[Any], None],
    ) -> None:
        """Fly by `flight`; `home` is where it was armed (NED), `items` the mission at present."""
        self._flight = flight
        self._items = items
        self._home = home
        self._say = say
        self.item: int | None = None
        """The item that it flies; None: it flies none."""

    def join(self) -> bool:
        """Fly the return path from its nearest leg on; False without one."""
        items = self._items()
        starts = [
            index
            for index, item in enumerate(items)
            if item.command == mavlink.MAV_CMD_DO_RETURN_PATH_START
        ]
        if not starts:
            return False
        places = {
            index: self._place(items[index])
            for index in range(starts[0] + 1, len(items))
            if items[index].command == mavlink.MAV_CMD_NAV_WAYPOINT
        }
        here = self._flight.believed.position[:2]
        numbers = list(places)
        best, self.item = math.inf, numbers[0]
        for one, other in itertools.pairwise(numbers):
            away = _distance(here, places[one][:2], places[other][:2])
            if away < best:
                best, self.item = away, other
        if len(numbers) > 1 and math.dist(here, places[numbers[0]][:2]) <= best:
            self.item = numbers[0]
        return True

    def leave(self) -> None:
        """Fly it no more."""
        self.item = None

    def advance(self) -> None:
        """Fly on towards the item, or on to the next one."""
        items = self._items()
        if self.item is None or not self._flight.flying:
            return
        item = items[self.item]
        place = self._place(item)
        if item.command == mavlink.MAV_CMD_NAV_LAND:
            place[2] = self._flight.believed.position[2]
        reached = float(np.linalg.norm(self._flight.believed.position - place)) < _NEAR
        if not reached:
            self._flight.target = GuidedTarget(place, None, None, None)
            return
        self._say(mavlink.MAVLink_mission_item_reached_message(self.item))
        if item.command == mavlink.MAV_CMD_NAV_LAND or self.item + 1 == len(items):
            self.item = None
            self._flight.land()
        else:
            self.item += 1

    def current(self) -> Any:  # noqa: ANN401 - pymavlink has no types
        """MISSION_CURRENT."""
        return mavlink.MAVLink_mission_current_message(
            self.item or 0, max(0, len(self._items()) - 1)
        )

    def _place(self, item: Any) -> Vector:  # noqa: ANN401
        place = self._flight.origin.to_local(item.x / _EARTH, item.y / _EARTH, 0.0)
        place[2] = item.z + self._flight.enu(self._home())[2]
        return place


def _distance(here: Vector, start: Vector, end: Vector) -> float:
    """From a point to a leg."""
    along = end - start
    share = float(np.clip((here - start) @ along / max(1e-9, float(along @ along)), 0.0, 1.0))
    return float(np.linalg.norm(here - start - share * along))
