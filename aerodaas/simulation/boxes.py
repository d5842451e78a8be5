"""3D boxes around the objects of a world, the ground truth of detections."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Box"]

_SIGNS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


@dataclass(frozen=True, slots=True)
class Box:
    """An upright box: centre in ENU metres, extents along its own axes, yaw in radians."""

    id: str
    """Id of the enclosed entity."""
    label: str
    """`person`, `vest`, `car`, `tower`, `tree`, `building`, `crop_rows`, `rubble` or
    `fence`."""
    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    """Extents along its yaw, across it and up, metres."""
    yaw: float = 0.0

    @property
    def corners(self) -> NDArray[np.float64]:
        """Corners as (8, 3) ENU metres."""
        local = _SIGNS * np.array(self.size)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(local @ turn + np.array(self.centre))

    def contains(self, point: tuple[float, float, float], margin: float = 0.0) -> bool:
        """Whether an ENU point lies within the box, widened by `margin` metres."""
        x, y, z = (here - there for here, there in zip(point, self.centre, strict=True))
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        own = (c * x + s * y, c * y - s * x, z)
        return all(
            abs(part) <= 0.5 * extent + margin for part, extent in zip(own, self.size, strict=True)
        )
