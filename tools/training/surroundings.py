"""Other surroundings for people in cuts: what stands beside a head must not pass for an arm."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.people.joints import BONES

__all__ = ["surrounded"]

_TRIES, _MOST = 12, 4
"""Places that are tried, and pieces at most that are put there."""

_SIDES = (0.06, 0.4)
"""Of a piece, in sides of the cut."""

_AWAY = 0.25
"""Of the person's size: standard deviation from a joint of the upper body to a piece's middle."""

_FLESH = 0.08
"""Of the person's size, from a bone to the outline, at most; a head is rounder."""
_SKULL = 0.13

_UPPER_BODY, _FACE = 11, 5
"""So many joints, from the first."""

_STEPS = np.linspace(0.0, 1.0, 9)[:, None]

Picture = NDArray[np.uint8]
Points = NDArray[np.float32]


def surrounded(
    image: Picture, points: Points, size: float, other: Picture, rng: np.random.Generator
) -> Picture:
    """Lay pieces of `other` around the person in `image`, near the head and arms but not on them.

    `points` (17, 3) are the person's joints (u, v, and 0 where none is known), `size` the longer
    side of the body in pixels. Joints that are not known may be hidden by a piece.
    """
    result = image.copy()
    known = np.flatnonzero(points[:_UPPER_BODY, 2] > 0)
    if not len(known):
        return result
    body, room = _outline(points, size)
    height, width = image.shape[:2]
    laid = 0
    for _ in range(_TRIES):
        sides = rng.uniform(*_SIDES, 2) * (width, height)
        middle = points[rng.choice(known), :2] + rng.normal(0.0, _AWAY * size, 2)
        low = np.clip(middle - sides / 2, 0, (width, height)).astype(int)
        high = np.clip(middle + sides / 2, 0, (width, height)).astype(int)
        touches = ((body > low - room) & (body < high + room)).all(axis=1).any()
        if touches or (high - low).min() < 1:
            continue
        result[low[1] : high[1], low[0] : high[0]] = _piece(other, high - low, rng)
        laid += 1
        if laid == _MOST:
            break
    return result


def _outline(points: Points, size: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Places along the bones (n, 2), and how far the body reaches from each (n, 1), in pixels."""
    seen = points[:, 2] > 0
    bones = [points[list(bone), :2] for bone in BONES if seen[list(bone)].all()]
    lines = [begin + _STEPS * (end - begin) for begin, end in bones]
    places = np.concatenate([points[seen, :2], *lines])
    room = np.full((len(places), 1), _FLESH * size)
    room[: seen[:_FACE].sum()] = _SKULL * size
    return places.astype(np.float32), room.astype(np.float32)


def _piece(picture: Picture, sides: NDArray[np.int_], rng: np.random.Generator) -> Picture:
    """Any piece of `picture`, larger or smaller than life, in pixels of `sides` (width, height)."""
    rows, columns = picture.shape[:2]
    zoom = float(np.exp(rng.uniform(-0.7, 1.1)))
    wide, high = np.clip(sides * zoom, 2, (columns, rows)).astype(int).tolist()
    left, top = (rng.random(2) * (columns - wide, rows - high)).astype(int).tolist()
    piece = picture[top : top + high, left : left + wide]
    return np.asarray(cv2.resize(piece, sides.tolist(), interpolation=cv2.INTER_AREA), np.uint8)
