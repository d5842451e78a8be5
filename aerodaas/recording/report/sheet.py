"""Contact sheet: a flight's key moments in one image."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.recording.report.moments import MomentPicture
from aerodaas.recording.report.overlay import draw_line

__all__ = ["contact_sheet"]

_COLUMNS = 3
_WIDTH = 480
"""Width of each tile in pixels."""
_GAP = 8


def contact_sheet(moments: Sequence[MomentPicture]) -> NDArray[np.uint8]:
    """Tile the images of `moments`, three per row, each with its caption; BGR."""
    tiles = [_tile(moment) for moment in moments]
    rows = [tiles[at : at + _COLUMNS] for at in range(0, len(tiles), _COLUMNS)]
    strips = []
    for row in rows:
        height = max(tile.shape[0] for tile in row)
        strip = np.full((height + _GAP, _COLUMNS * (_WIDTH + _GAP), 3), 255, np.uint8)
        for place, tile in enumerate(row):
            left = place * (_WIDTH + _GAP)
            strip[: tile.shape[0], left : left + _WIDTH] = tile
        strips.append(strip)
    return np.concatenate(strips)


def _tile(moment: MomentPicture) -> NDArray[np.uint8]:
    height, width = moment.image.shape[:2]
    size = (_WIDTH, max(1, round(height * _WIDTH / width)))
    image = np.asarray(cv2.resize(moment.image, size, interpolation=cv2.INTER_AREA), np.uint8)
    draw_line(image, moment.caption)
    return image
