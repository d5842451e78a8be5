"""Depth as a small grey picture, to be coloured and laid over the image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.depth import METRE

__all__ = ["depth_picture"]

_WIDEST = 320
"""Pixels across, at most; wider depth is thinned out, not blurred over edges."""
_SHADES = 254
"""Shades from nearest to farthest; a further one, 0, is for what was not measured."""
_FARTHEST = 99.0
"""Percentile of the measured that the range holds: single far pixels do not stretch it."""
_STEPS = (1.0, 2.0, 3.0, 5.0, 7.0)
"""Ranges, times powers of ten, so that the colours do not change with each picture."""


def depth_picture(depth: NDArray[np.uint16]) -> tuple[bytes, float]:
    """Draw depth.

    Args:
        depth: Height x width of millimetres, 0 where not measured.

    Returns:
        A PNG of 8-bit grey, at most 320 pixels across: 0 where nothing was measured, else 1 at the
        camera to 255 at the range and beyond. And that range in metres: the least of 1, 2, 3, 5, 7,
        10, 20, ... that holds 99 % of what was measured; 1 where nothing was.
    """
    step = -(-depth.shape[1] // _WIDEST)
    metres = depth[::step, ::step].astype(np.float32) / METRE
    measured = metres > 0
    farthest = float(np.percentile(metres[measured], _FARTHEST)) if measured.any() else 0.0
    reach = _range(farthest)
    shades = 1 + np.rint(np.minimum(metres / reach, 1.0) * _SHADES)
    grey = np.where(measured, shades, 0).astype(np.uint8)
    return cv2.imencode(".png", grey, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes(), reach


def _range(farthest: float) -> float:
    """The least range that holds `farthest`; depth of 16 bits reaches 65.5 m."""
    ranges = [step * scale for scale in (1.0, 10.0) for step in _STEPS]
    return next(one for one in ranges if one >= farthest)
