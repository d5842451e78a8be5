"""Faults in flight, and the actions that they demand."""

from __future__ import annotations

import enum
from dataclasses import dataclass

__all__ = ["FailsafeAction", "Fault"]


class FailsafeAction(enum.IntEnum):
    """Failsafe actions in increasing severity."""

    NOTHING = 0
    HOLD = 1
    """Stand still: the link is lost, perhaps only for a moment."""
    RETURN = 2
    LAND = 3
    RELEASE = 4
    """Stop sending setpoints: a pilot or the autopilot's own failsafe flies."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault and the failsafe action that it demands."""

    demand: FailsafeAction
    kind: str
    """Short machine-readable name, such as `battery_low`."""
    text: str
    """One sentence for the operator."""
    about: str = ""
    """Whom it is about, where several of one kind are told apart."""
