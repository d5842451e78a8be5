"""Other aircraft around a vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass

from aerodaas.types.geometry import Vector
from aerodaas.types.records import fast_pickle

__all__ = ["Traffic"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class Traffic:
    """One aircraft, where it is at the stamp of the state that it stands in."""

    address: int
    """24-bit ICAO address."""
    callsign: str
    """Its callsign; its address in hexadecimal digits where it tells none."""
    position: Vector
    """ENU metres; `up` is NaN where its height is not known."""
    velocity: Vector
    """ENU m/s; zero where it is not known."""
    age: float = 0.0
    """Seconds since it was last heard; its way since then is as its velocity says."""

    @property
    def knows_height(self) -> bool:
        """Whether its height is known."""
        return math.isfinite(self.position[2])
