"""How a person looks, in 24 bytes: colours of head, sleeves, chest and legs, for telling two apart.

Each zone has a fixed place relative to the chest. What resembles the picture beside the body, at
the same height, is left out as background. Colours are a brightness and two opponent channels, as
in Swain and Ballard, "Color indexing" (1991); of each the 30th and 70th percentile.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import Box

__all__ = ["ZONES", "ZONE_BYTES", "appearance_in_box", "unlikeness"]


class _Zone(NamedTuple):
    """Rows from and to, in heights of the chest below its top; columns likewise from its middle."""

    top: float
    bottom: float
    inner: float
    outer: float


_CHEST: Mapping[str, tuple[float, float]] = {
    "vest": (0.0, 1.0),
    "hazard vest": (0.0, 1.0),
    "person": (0.14, 0.32),
}
"""By label, the chest's top and height in parts of the box's; other labels have no appearance."""
_EDGE = 2.0
"""Pixels from the picture's edge within which a box is cut off by it."""
_ZONES = (
    _Zone(-0.38, -0.08, 0.0, 0.14),
    _Zone(0.08, 0.75, 0.26, 0.52),
    _Zone(0.1, 0.9, 0.0, 0.22),
    _Zone(1.1, 1.7, 0.0, 0.26),
)
"""Head, sleeves, chest, thighs."""
_BESIDE = (0.68, 1.08)
"""Columns of the background."""
_CHEST_ZONE = 2
"""Whose box the detector gave, so that nothing in it is background."""
_SMALLEST = 16.0
"""Pixels of the chest's height; less shows no clothes."""
_PITCH = 1 / 12
"""Distance of samples, in heights of the chest."""
_ROWS = np.arange(-0.38, 1.7, _PITCH)
_COLUMNS = np.arange(-1.08 + _PITCH / 2, 1.08, _PITCH)
"""Grid of the samples: rows below the chest's top, columns from its middle, in its heights."""
_FEWEST = 6
"""Samples that a zone needs."""
_BODY_SHARE = 0.12
"""Least share of a zone that is not background."""
_DISTINCT = 15.0
"""Difference of colour, of 255, from which a sample is no background."""
_NEIGHBOURS = 3
"""Number of the most similar samples of the background that are compared."""
_LOW, _HIGH = 0.3, 0.7
_CHANNELS = 3
_FROM_BGR = np.array([[0.2, 0.0, -0.5], [0.2, -0.5, 0.25], [0.2, 0.5, 0.25]])
"""Brightness, red against green, and both against blue. Brightness counts for less, as it changes
with light and shade."""
_LIGHT = 78.0
"""Brightness to which the chest is scaled, in the unit of `_FROM_BGR`."""
_MIDDLE = np.array([0.0, 128.0, 128.0])
_CAP = 20.0
"""Greatest difference of one zone; an arm may be hidden, or the background like a sleeve."""
_LEAST_ZONES = 2
"""Zones that two appearances must have in common to be compared."""
ZONES = len(_ZONES)
"""Number of zones of an appearance: head, sleeves, chest, thighs."""
ZONE_BYTES = 2 * _CHANNELS
"""Bytes of a zone; all zero where it cannot be told."""
_UNKNOWN = bytes(ZONE_BYTES)


def _grid(top: float, bottom: float, inner: float, outer: float) -> NDArray[np.bool_]:
    rows = (top <= _ROWS) & (bottom > _ROWS)
    columns = (inner <= np.abs(_COLUMNS)) & (np.abs(_COLUMNS) < outer)
    return np.asarray(rows[:, None] & columns[None])


_BODIES = [_grid(*zone) for zone in _ZONES]
_BACKGROUNDS = [_grid(zone.top, zone.bottom, *_BESIDE) for zone in _ZONES]


def appearance_in_box(image: NDArray[np.uint8], box: Box, label: str) -> bytes | None:
    """Describe the person in a box.

    Args:
        image: Picture, height x width x 3, BGR.
        box: Left, top, right, bottom in pixels.
        label: What the box shows.

    Returns:
        The appearance; None for labels of other things, if the picture's edge cuts the box, for who
        lies, and if fewer than two zones can be told.
    """
    if label not in _CHEST or not all(map(np.isfinite, box)):
        return None
    start, share = _CHEST[label]
    left, top, right, bottom = box
    height, width = image.shape[:2]
    # What is cut off hides where the chest is.
    if min(left, top) < _EDGE or right > width - _EDGE or bottom > height - _EDGE:
        return None
    tall = bottom - top
    if right - left > tall:
        return None
    middle, neck, chest = (left + right) / 2, top + start * tall, share * tall
    if chest < _SMALLEST:
        return None
    down = np.rint(neck + _ROWS * chest).astype(np.intp)
    across = np.rint(middle + _COLUMNS * chest).astype(np.intp)
    rows, columns = (down >= 0) & (down < height), (across >= 0) & (across < width)
    pixels = image[np.ix_(down.clip(0, height - 1), across.clip(0, width - 1))]
    inside = None if rows.all() and columns.all() else rows[:, None] & columns[None]
    colours = pixels.astype(np.float64) @ _FROM_BGR
    brightness = np.sort(colours[_within(_BODIES[_CHEST_ZONE], inside)][:, 0])
    if not brightness.size:
        return None
    # What is in the shade is darker in all zones.
    colours *= _LIGHT / max(brightness[int(_HIGH * brightness.size)], 1.0)
    colours += _MIDDLE
    zones = [_zone(colours, inside, number) for number in range(ZONES)]
    return b"".join(zones) if len(zones) - zones.count(_UNKNOWN) >= _LEAST_ZONES else None


def unlikeness(some: Sequence[bytes], others: Sequence[bytes]) -> float | None:
    """Difference between appearances of two people, in parts of 255.

    Args:
        some: Appearances of the first.
        others: Appearances of the second.

    Returns:
        The median over all pairs, 0 to 20; None if no pair can be compared.
    """
    if not (some and others):
        return None
    first, second = (
        np.frombuffer(b"".join(each), np.uint8).reshape(-1, ZONES, ZONE_BYTES)
        for each in (some, others)
    )
    a, b = first[:, None].astype(np.float64), second[None].astype(np.float64)
    known = a.any(axis=3) & b.any(axis=3)
    off = (a - b).reshape(*known.shape, 2, _CHANNELS)
    zones = np.minimum(np.sqrt((off**2).sum(axis=4).mean(axis=3)), _CAP)
    count = known.sum(axis=2)
    compared = count >= _LEAST_ZONES
    if not compared.any():
        return None
    mean = (zones * known).sum(axis=2)[compared] / count[compared]
    return float(np.median(mean))


def _within(zone: NDArray[np.bool_], inside: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    return zone if inside is None else zone & inside


def _zone(
    colours: NDArray[np.float64],
    inside: NDArray[np.bool_] | None,
    number: int,
) -> bytes:
    """Describe a zone of the colours on the grid; `inside` is None if all are in the picture."""
    found = colours[_within(_BODIES[number], inside)]
    if number != _CHEST_ZONE and len(found) >= _FEWEST:
        beside = colours[_within(_BACKGROUNDS[number], inside)]
        if len(beside) > _NEIGHBOURS:
            # Squared distances by one product, |a|² + |b|² - 2ab.
            squares = np.einsum("ij,ij->i", found, found), np.einsum("ij,ij->i", beside, beside)
            off = squares[0][:, None] + squares[1] - 2.0 * (found @ beside.T)
            off.partition(_NEIGHBOURS - 1, axis=1)
            body = off[:, _NEIGHBOURS - 1] > _DISTINCT**2
            found = found[body] if np.count_nonzero(body) >= _BODY_SHARE * len(body) else found[:0]
    if len(found) < _FEWEST:
        return _UNKNOWN
    ordered = np.sort(found, axis=0)
    ends = ordered[[int(_LOW * len(found)), int(_HIGH * len(found))]]
    return np.rint(ends).clip(1, 255).astype(np.uint8).tobytes()
