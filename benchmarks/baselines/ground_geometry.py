"""Where on flat ground a pixel of a level camera's picture lies."""

from __future__ import annotations

import math
from typing import Any

from ardupilot_copter import Copter
from numpy.typing import NDArray

LENS = math.radians(82.6)


def focal(image: NDArray[Any]) -> float:
    """Focal length in pixels."""
    return float(image.shape[1] / 2 / math.tan(LENS / 2))


def bearing(image: NDArray[Any], u: float) -> float:
    """Direction of a column, radians to the left of where the camera looks."""
    return math.atan2(image.shape[1] / 2 - u, focal(image))


def yaw(copter: Copter) -> float:
    """Where the vehicle looks, radians counter-clockwise from east."""
    return math.pi / 2 - float(copter.newest("ATTITUDE").yaw)


def distance(image: NDArray[Any], v: float, copter: Copter, camera_pitch: float) -> float:
    """Metres along the ground to a row; infinite at and above the horizon."""
    below = (
        math.atan2(v - image.shape[0] / 2, focal(image))
        + camera_pitch
        - copter.newest("ATTITUDE").pitch
    )
    return copter.position[2] / math.tan(below) if below > 0 else math.inf


def place(copter: Copter, direction: float, metres: float) -> tuple[float, float]:
    """What lies so far in a direction, metres east and north of home."""
    x, y, _ = copter.position
    angle = yaw(copter) + direction
    return x + metres * math.cos(angle), y + metres * math.sin(angle)
