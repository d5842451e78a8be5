"""The target of a recorded command, which is checked: a recording may be a stranger's."""

from __future__ import annotations

import math
from typing import Any

from aerodaas.messages.frames import Header
from aerodaas.messages.waypoints import FollowedTarget, TargetState

__all__ = ["NAVIGATION_SCHEMA", "target_of"]

NAVIGATION_SCHEMA = "aerodaas.Navigation"
_CORNERS = 4


def target_of(navigation: dict[str, Any], header: Header) -> FollowedTarget | None:
    """What was followed in the frame of `header`, by recorded navigation; None for nothing.

    None as well for navigation of another frame, of an older version, and for what is malformed.
    """
    if (navigation.get("stamp"), navigation.get("source")) != (header.stamp, header.source):
        return None
    commands = navigation.get("commands")
    first = commands[0] if isinstance(commands, list) and commands else None
    told = first.get("target") if isinstance(first, dict) else None
    if not isinstance(told, dict):
        return None
    try:
        return FollowedTarget(TargetState(told.get("state")), _box(told.get("box")))
    except (TypeError, ValueError, OverflowError):
        return None


def _box(told: object) -> tuple[float, float, float, float] | None:
    """Four finite numbers; None for None, raises ValueError or TypeError for anything else."""
    if told is None:
        return None
    if not isinstance(told, list) or len(told) != _CORNERS:
        raise ValueError
    left, top, right, bottom = map(float, told)
    if not all(map(math.isfinite, (left, top, right, bottom))):
        raise ValueError
    return left, top, right, bottom
