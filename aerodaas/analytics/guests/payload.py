"""Guests and actuators: a guest's navigation moves none."""

from __future__ import annotations

from typing import TypeVar

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import GraphError

__all__ = ["require_no_moves"]


T = TypeVar("T")


def require_no_moves(item: T, guest: str) -> T:
    """Return an item; raises GraphError for navigation whose waypoints move actuators."""
    waypoints = item.waypoints if isinstance(item, AeroNavigation) else ()
    for waypoint in waypoints:
        if waypoint.actuate:
            raise GraphError(
                f"{guest} is a guest and moves no actuators: waypoint {waypoint.id!r} has `actuate`"
            )
    return item
