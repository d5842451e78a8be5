"""Distance of a box from a depth image that is aligned with the camera's.

Depth pictures are height x width of uint16: millimetres along the optical axis, 0 where nothing
was measured, as REP 118 of ROS has them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import Box

__all__ = ["METRE", "depth_in_box", "nearest_in_cells"]

METRE = 1000.0
"""Units of a depth image in one metre."""
_INNER = 0.25
"""Part of a box's sides left out at each edge, where the background shows beside a body."""
_LEAST = 0.3
"""Part of the pixels in the inner box that must have been measured."""
_ROWS, _COLUMNS = 18, 32
"""Cells of a coarse image."""
_STEP = 2
"""Of a cell's pixels, every second in both directions is looked at."""
_SPECKLE = 0.05
"""Part of a cell's pixels that may be nearer by mistake."""


def depth_in_box(depth: NDArray[np.uint16], box: Box) -> float | None:
    """Metres along the optical axis to the surface in the middle of a box, the median.

    Args:
        depth: Depth picture, height x width, millimetres; 0 where not measured.
        box: Left, top, right, bottom in its pixels.

    Returns:
        Metres, or None where too little of it was measured, or the box is none.
    """
    if not np.isfinite(box).all():
        return None
    height, width = depth.shape
    left, top, right, bottom = box
    margin_u, margin_v = _INNER * (right - left), _INNER * (bottom - top)
    columns = np.clip([left + margin_u, right - margin_u], 0, width).round().astype(int)
    rows = np.clip([top + margin_v, bottom - margin_v], 0, height).round().astype(int)
    inner = depth[rows[0] : rows[1], columns[0] : columns[1]]
    measured = inner[inner > 0]
    if not inner.size or measured.size < _LEAST * inner.size:
        return None
    return float(np.median(measured)) / METRE


def nearest_in_cells(depth: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Of each cell of 18 x 32 the nearest that was measured, in millimetres; 0 where nothing was.

    Single pixels count for nothing. Pixels that fit into no whole cell are left out: on the right
    and below, less than a cell.
    """
    rows, columns = min(_ROWS, depth.shape[0]), min(_COLUMNS, depth.shape[1])
    tall, wide = depth.shape[0] // rows, depth.shape[1] // columns
    whole = depth[: tall * rows, : wide * columns].reshape(rows, tall, columns, wide)
    pixels = whole[:, ::_STEP, :, ::_STEP].swapaxes(1, 2).reshape(rows, columns, -1)
    # Unsigned zeros become the farthest of all.
    below = int(_SPECKLE * pixels.shape[-1])
    nearest = np.partition(pixels - np.uint16(1), below, axis=-1)[..., below]
    return np.asarray(nearest + np.uint16(1), np.uint16)
