"""When everything happened in a recorded flight, so that a replay lets it happen then again."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field

from aerodaas.types.status import ReceivedMessage

__all__ = ["NEVER", "ReplayTimeline", "later"]

NEVER = 2**63 - 1
"""A stamp that does not come."""


@dataclass(frozen=True)
class ReplayTimeline:
    """Mission times, in nanoseconds and in order, of what a flight has done; empty for a new one.

    What a recording tells nothing of happens as in any other flight.
    """

    readings: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Frames and other measurements, by stream."""
    turns: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Of the setpoint loop, by robot."""
    plans: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Turns at which a plan had come from the trajectory scheduler, by robot."""
    heard: dict[str, tuple[ReceivedMessage, ...]] = field(default_factory=dict)
    """Navigation and commands that reached a mission by stream, by robot."""
    work: dict[str, dict[str, dict[int, int | None]]] = field(default_factory=dict)
    """What an analysis (by stream) worked on (by source and stamp), and the stamp of the vehicle's
    state that it went by, if by any."""


def later(stamps: tuple[int, ...], after: int) -> int:
    """The first of `stamps` later than `after`; NEVER if there is none."""
    place = bisect_right(stamps, after)
    return stamps[place] if place < len(stamps) else NEVER
