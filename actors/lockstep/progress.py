"""What a dispatcher with simulated executions tells the conductor of mission time."""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.types.records import fast_pickle

__all__ = ["Progress"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class Progress:
    """Messages that it has, and results that it has published since it last told."""

    received: tuple[tuple[str, int], ...]
    """Source and timestamp of each measurement, or of each step of mission time that is done."""
    answered: tuple[tuple[str, str, int], ...] = ()
    """Stream of each result, and source and timestamp of the measurement that it was made from."""
