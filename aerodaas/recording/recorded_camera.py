"""A camera's model from its recorded calibration and mount: a stranger's data, checked."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from aerodaas.geometry.frames import CameraModel, angles_of_rotation
from aerodaas.recording.rotation import OPTICAL, Rotation, compose

__all__ = ["CALIBRATION_SCHEMA", "MOUNT_SCHEMA", "camera_of"]

CALIBRATION_SCHEMA = "foxglove.CameraCalibration"
MOUNT_SCHEMA = "foxglove.FrameTransform"
_MATRIX = 9
_UNIT = 1e-3
"""How far a quaternion's length may be from one."""
_MOST_PIXELS = 1 << 16


def camera_of(calibration: Any, mount: Any) -> CameraModel | None:  # noqa: ANN401 - protobuf
    """The camera of a `foxglove.CameraCalibration` and a `foxglove.FrameTransform` on its body.

    None for what is no camera: figures that are not finite, no pixels, or no rotation.
    """
    matrix = [float(one) for one in calibration.K]
    place = tuple(float(getattr(mount.translation, axis)) for axis in "xyz")
    x, y, z, w = (float(getattr(mount.rotation, axis)) for axis in "xyzw")
    if len(matrix) != _MATRIX or not all(map(math.isfinite, (*matrix, *place, x, y, z, w))):
        return None
    fx, fy, cx, cy = matrix[0], matrix[4], matrix[2], matrix[5]
    pixels = int(calibration.width), int(calibration.height)
    size = math.hypot(x, y, z, w)
    if not (min(fx, fy) > 0.0 and min(pixels) > 0 and max(pixels) <= _MOST_PIXELS):
        return None
    if not abs(size - 1.0) <= _UNIT:
        return None
    ox, oy, oz, ow = OPTICAL
    unit = (x / size, y / size, z / size, w / size)
    roll, pitch, yaw = angles_of_rotation(_matrix(compose(unit, (-ox, -oy, -oz, ow))))
    first, second, third = place
    return CameraModel(*pixels, fx, fy, cx, cy, (first, second, third), pitch, yaw, roll)


def _matrix(rotation: Rotation) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Rotation matrix (3, 3) of a unit quaternion."""
    x, y, z, w = rotation
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
