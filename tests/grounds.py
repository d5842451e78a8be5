"""Ground for tests, by a function of place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerodaas.config.model import LimitsConfig
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.terrain.ground import Ground
from aerodaas.terrain.terrain import Terrain
from aerodaas.terrain.tile import Grid, Tile

__all__ = ["ORIGIN", "clearance", "ground"]

ORIGIN = GeodeticOrigin(47.0, 8.0, 585.0)
_STEP = 5.0
"""Metres between samples, about."""
Shape = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""Height at metres east and north; NaN is a hole."""


def ground(
    shape: Shape, reach: float = 150.0, takeoff: tuple[float, float, float] = (0, 0, 0)
) -> Ground:
    """Ground of this shape, whose zero is the take-off's."""
    degrees = _STEP / 111_200.0
    side = 2 * int((reach + 300.0) / _STEP)
    grid = Grid(
        47.0 + side / 2 * degrees, 8.0 - side / 2 * degrees / 0.682, degrees, degrees / 0.682,
        side + 1, side + 1,
    )  # fmt: skip
    steps = np.arange(side + 1)
    north, east = np.meshgrid((side / 2 - steps) * _STEP, (steps - side / 2) * _STEP, indexing="ij")
    samples = 500.0 + shape(east.astype(np.float64), north.astype(np.float64))
    tile = Tile(Path("made up"), grid, lambda: samples, None)
    return Ground(Terrain([tile]), ORIGIN, np.array(takeoff, dtype=np.float64), reach)


def clearance(shape: Shape, limits: LimitsConfig, metres: float = 5.0) -> GroundClearance:
    """Keep this far above ground of this shape."""
    return GroundClearance(ground(shape, limits.max_range), metres, limits)
