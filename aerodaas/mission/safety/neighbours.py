"""What flies beside a drone, as far as it is kept away from."""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.types.geometry import Vector

__all__ = ["Neighbour"]


@dataclass(frozen=True, slots=True, eq=False)
class Neighbour:
    """Something else that flies: position (ENU metres) and velocity (ENU m/s)."""

    position: Vector
    """`up` is NaN for an aircraft whose height is not known."""
    velocity: Vector
    apart: tuple[float, float] | None = None
    """Metres along the ground and in height to keep from an aircraft that does not give way: one of
    the two is enough. None: another drone of ours, which brakes, too."""
