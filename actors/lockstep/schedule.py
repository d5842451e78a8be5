"""Schedule of a lockstep run for the drone's actor, which conducts its time."""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = ["LockstepSchedule"]


@dataclass(frozen=True)
class LockstepSchedule:
    """Sources of measurements and the acknowledgements to wait for."""

    rates: dict[str, float]
    """Rates in Hz of the sources of other actors (cameras, external analyses)."""
    acknowledgements: dict[str, int]
    """Number of acknowledgements of one measurement, by source."""
    windows: dict[str, int]
    """Most unprocessed measurements while time advances, by source."""
    readers: tuple[str, ...] = ()
    """Streams of acknowledgements."""
    answers: dict[str, int] = field(default_factory=dict)
    """Number of acknowledgements of one result, by stream, of the analyses whose executions are
    simulated; empty where all work is done in the moment of its measurement."""
    patience: float = 20.0
    """Timeout of an acknowledgement in wall seconds."""
