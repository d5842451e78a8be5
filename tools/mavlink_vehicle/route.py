"""The mission that an emulated autopilot flies by itself: one that it is given, or its way home."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.geometry.frames import Vector
from tools.mavlink_vehicle.flight import GuidedTarget, MavFlight

__all__ = ["Route"]

_NEAR = 1.0
"""Metres within which a waypoint is reached."""
_EARTH = 1e7
_STAYS = {mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_LOITER_TIME}
"""Items whose first parameter is how long it stays there, seconds."""


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
        self._selected = 0
        self._there_since: float | None = None
        self._usual = flight.fastest

    def select(self, item: int) -> bool:
        """Begin with this item; False if there is none."""
        known = item < len(self._items())
        if known:
            self._selected = item
            if self.item is not None:
                self.item, self._there_since = item, None
        return known

    def begin(self) -> bool:
        """Fly the mission from the selected item on; False without one."""
        if not self._items():
            return False
        # ArduPilot's first item is its home.
        self.item, self._there_since = self._selected, None
        return True

    def leave(self) -> None:
        """Fly it no more."""
        if self.item is not None:
            self._selected, self.item = self.item, None
        self._flight.fastest = self._usual

    def advance(self, now: float) -> None:
        """Fly on towards the item, or on to the next one; `now` in seconds."""
        items = self._items()
        if self.item is None or not self._flight.flying:
            return
        item = items[self.item]
        if item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            self._flight.return_home()
        elif item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            self._flight.fastest = item.param2
            self._go_on(items)
        elif self._stayed(item, now):
            self._say(mavlink.MAVLink_mission_item_reached_message(self.item))
            if item.command == mavlink.MAV_CMD_NAV_LAND:
                self.item = None
                self._flight.land()
            else:
                self._go_on(items)

    def _go_on(self, items: list[Any]) -> None:
        assert self.item is not None  # noqa: S101 - it flies one
        self._there_since = None
        if self.item + 1 < len(items):
            self.item += 1
        else:
            self.item = None
            self._flight.hold()

    def _stayed(self, item: Any, now: float) -> bool:  # noqa: ANN401
        """Fly on to an item's place; whether it has stayed there for as long as it is to."""
        place = self._place(item)
        if item.command == mavlink.MAV_CMD_NAV_LAND:
            place[2] = self._flight.believed.position[2]
        if self._there_since is None:
            if float(np.linalg.norm(self._flight.believed.position - place)) >= _NEAR:
                self._flight.target = GuidedTarget(place, None, None, None)
                return False
            self._there_since = now
        stays = item.command in _STAYS
        return now - self._there_since >= (item.param1 if stays else 0.0)

    def current(self) -> Any:  # noqa: ANN401 - pymavlink has no types
        """MISSION_CURRENT."""
        return mavlink.MAVLink_mission_current_message(
            self._selected if self.item is None else self.item, max(0, len(self._items()) - 1)
        )

    def _place(self, item: Any) -> Vector:  # noqa: ANN401
        place = self._flight.origin.to_local(item.x / _EARTH, item.y / _EARTH, 0.0)
        if item.frame == mavlink.MAV_FRAME_GLOBAL:
            place[2] = self._flight.believed.position[2] + self._flight.rise_to(item.z)
        else:
            place[2] = item.z + self._flight.enu(self._home())[2]
        return place


def _distance(here: Vector, start: Vector, end: Vector) -> float:
    """From a point to a leg."""
    along = end - start
    share = float(np.clip((here - start) @ along / max(1e-9, float(along @ along)), 0.0, 1.0))
    return float(np.linalg.norm(here - start - share * along))
