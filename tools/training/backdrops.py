"""Backgrounds that no renderer draws: what is behind a thing must not matter.

Overlapping shapes of every size ("dead leaves": Lee, Mumford and Huang, 2001) have the
statistics of natural pictures, and light falls in patches as below trees.
"""

from __future__ import annotations

import colorsys

import cv2
import numpy as np
from numpy.typing import NDArray

from tools.training.colours import hi_vis

__all__ = ["backdrop", "compose", "field"]

Picture = NDArray[np.uint8]

_BARRED = 0.65
"""Share of backdrops with something drawn into them that a lattice might be taken for."""


def field(shape: tuple[int, int], cells: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Smooth random field (height, width) about 0, of some `cells` bumps across."""
    height, width = shape
    size = max(2, round(cells)), max(2, round(cells * height / width))
    coarse = rng.standard_normal((size[1], size[0]), dtype=np.float32)
    return np.asarray(
        cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC), np.float32
    )


def backdrop(shape: tuple[int, int], rng: np.random.Generator) -> Picture:
    """Return a picture (height, width, 3) of nothing in particular."""
    height, width = shape
    picture = np.empty((height, width, 3), np.float32)
    top, bottom = _tone(rng), _tone(rng)
    share = np.linspace(0, 1, height, dtype=np.float32)[:, None, None]
    picture[:] = top * (1 - share) + bottom * share
    canvas = np.clip(picture, 0, 255).astype(np.uint8)
    kinds = int(rng.integers(5))
    for _ in range(int(rng.integers(10, 120))):
        _leaf(canvas, kinds, rng)
    for _ in range(int(rng.integers(5)) if rng.random() < _BARRED else 0):
        _DRAWN[rng.integers(len(_DRAWN))](canvas, rng)
    result = canvas.astype(np.float32)
    for cells in rng.choice([4.0, 12.0, 40.0, 110.0, 250.0], 2, replace=False):
        result *= 1.0 + rng.uniform(0.0, 0.28) * field(shape, cells, rng)[..., None]
    return np.clip(result, 0, 255).astype(np.uint8)


def _tone(rng: np.random.Generator) -> NDArray[np.float32]:
    """Colour of earth, walls, leaves or sky, seldom a garish one; BGR, 0 to 255."""
    if rng.random() < 0.06:  # noqa: PLR2004 - seldom
        red, green, blue = hi_vis(rng)
    else:
        hue = rng.choice([rng.uniform(0.02, 0.16), rng.uniform(0.2, 0.4), rng.uniform()])
        red, green, blue = colorsys.hsv_to_rgb(hue, rng.beta(1.2, 2.5), rng.uniform(0.03, 1.0))
    return np.array([blue, green, red], np.float32) * 255


def _leaf(canvas: Picture, kinds: int, rng: np.random.Generator) -> None:
    """Draw one shape; sizes fall off as in pictures of the world."""
    height, width = canvas.shape[:2]
    radius = 0.012 * width / rng.uniform(0.03, 1.0) ** 0.9
    centre = rng.uniform((0, 0), (width, height))
    colour = _tone(rng).tolist()
    kind = kinds if kinds < 4 else rng.integers(4)  # noqa: PLR2004 - the fifth is a mixture
    if kind == 0:
        axes = (int(radius) + 1, int(radius * rng.uniform(0.2, 1.0)) + 1)
        middle = (int(centre[0]), int(centre[1]))
        cv2.ellipse(canvas, middle, axes, rng.uniform(0, 180), 0, 360, colour, -1)
        return
    if kind == 1:
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 8)))
        reach = radius * rng.uniform(0.4, 1.2, len(angles))[:, None]
        points = centre + reach * np.stack([np.cos(angles), np.sin(angles)], -1)
    else:
        # Planks, trunks, kerbs and walls: upright ones more often.
        long, wide = radius * rng.uniform(1.0, 4.0), radius * rng.uniform(0.1, 1.0)
        angle = rng.normal(np.pi / 2, 0.1) if rng.integers(2) else rng.uniform(0, np.pi)
        along = np.array([np.cos(angle), np.sin(angle)])
        across = np.array([-along[1], along[0]]) * wide
        ends = centre - along * long, centre + along * long
        points = np.array([ends[0] - across, ends[1] - across, ends[1] + across, ends[0] + across])
        if kind == 3:  # noqa: PLR2004 - stripes
            for k in range(0, 8, 2):
                low, high = (ends[0] + (ends[1] - ends[0]) * (k + i) / 8 for i in range(2))
                piece = np.array([low - across, high - across, high + across, low + across])
                cv2.fillConvexPoly(canvas, piece.astype(np.int32), colour)
            return
    cv2.fillPoly(canvas, [points.astype(np.int32)], colour)


def _grid(canvas: Picture, rng: np.random.Generator) -> None:
    """Draw bars that cross or stand side by side: windows, fences, shelves, blinds."""
    height, width = canvas.shape[:2]
    radius = rng.uniform(0.05, 0.7) * width
    corners = rng.uniform((0, 0), (width, height)) + radius * (
        np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * rng.uniform(0.3, 1.0, 2)
        + rng.normal(0.0, 0.15, (4, 2))
    )
    colour, thickness = _tone(rng).tolist(), int(rng.integers(1, 2 + max(1, int(radius / 40))))
    for first, second, third, fourth in ((0, 1, 3, 2), (0, 3, 1, 2)):
        if rng.random() < 0.25:  # noqa: PLR2004 - bars without bars across
            continue
        for share in np.linspace(0, 1, int(rng.integers(2, 14))):
            start = corners[first] * (1 - share) + corners[second] * share
            end = corners[third] * (1 - share) + corners[fourth] * share
            _line(canvas, start, end, colour, thickness)


def _twigs(canvas: Picture, rng: np.random.Generator) -> None:
    """Draw lines that part from each other: bare branches, wires, stalks."""
    height, width = canvas.shape[:2]
    place, angle = rng.uniform((0, 0), (width, height)), rng.uniform(0, 2 * np.pi)
    ends, length = [(place, angle)], rng.uniform(0.03, 0.25) * width
    colour = _tone(rng).tolist()
    for depth in range(int(rng.integers(2, 5))):
        grown = []
        for start, along in ends:
            for turn in rng.normal(0.0, 0.5, int(rng.integers(1, 4))):
                reach = length * rng.uniform(0.5, 1.0)
                end = start + reach * np.array([np.cos(along + turn), np.sin(along + turn)])
                _line(canvas, start, end, colour, max(1, 4 - depth))
                grown.append((end, along + turn))
        ends, length = grown, length * 0.7


def _letters(canvas: Picture, rng: np.random.Generator) -> None:
    """Write something: signs, screens, packets, signatures."""
    height, width = canvas.shape[:2]
    scale, font = float(np.exp(rng.uniform(-1.2, 1.4))), int(rng.integers(8))
    thickness = int(rng.integers(1, 2 + max(1, int(2 * scale))))
    colour, (u, v) = _tone(rng).tolist(), rng.uniform((-0.1, 0.0), (0.8, 1.0))
    for row in range(int(rng.integers(1, 9))):
        codes = rng.integers(40, 123, int(rng.integers(2, 16)))
        place = (int(u * width), int(v * height + 30 * scale * row))
        text = "".join(map(chr, codes.tolist()))
        cv2.putText(canvas, text, place, font, scale, colour, thickness, cv2.LINE_AA)


def _chessboard(canvas: Picture, rng: np.random.Generator) -> None:
    """Lay tiles in two colours: floors, cloths, screens."""
    height, width = canvas.shape[:2]
    side, rows, columns = rng.uniform(4, 40), int(rng.integers(2, 12)), int(rng.integers(2, 12))
    u, v = rng.uniform((-0.1, -0.1), (0.9, 0.9)) * (width, height)
    turn = rng.normal(0.0, 0.5, (2, 2)) * 0.4 + np.eye(2)
    colours = _tone(rng).tolist(), _tone(rng).tolist()
    for row in range(rows):
        for column in range(columns):
            cell = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) + np.array([column, row])
            points = ((cell * side) @ turn + (u, v)).astype(np.int32)
            cv2.fillConvexPoly(canvas, points, colours[(row + column) % 2])


def _ribs(canvas: Picture, rng: np.random.Generator) -> None:
    """Draw spokes from one point, perhaps with rings around: umbrellas, wheels, leaves, webs."""
    height, width = canvas.shape[:2]
    middle = rng.uniform((-0.1, -0.1), (1.1, 1.1)) * (width, height)
    radius = rng.uniform(0.05, 0.7) * width
    first, fan = rng.uniform(0, 2 * np.pi), rng.choice([2 * np.pi, rng.uniform(0.5, 3.0)])
    colour, thickness = _tone(rng).tolist(), int(rng.integers(1, 4))
    for angle in first + np.linspace(0.0, fan, int(rng.integers(5, 24))):
        end = middle + radius * np.array([np.cos(angle), np.sin(angle)])
        _line(canvas, middle, end, colour, thickness)
    place = (int(middle[0]), int(middle[1]))
    for share in rng.uniform(0.2, 1.0, int(rng.integers(0, 5))):
        cv2.circle(canvas, place, int(share * radius), colour, thickness, cv2.LINE_AA)


def _strands(canvas: Picture, rng: np.random.Generator) -> None:
    """Draw bent lines side by side or across each other: hair, grass, cables, noodles."""
    height, width = canvas.shape[:2]
    middle = rng.uniform((0, 0), (width, height))
    spread, length = rng.uniform(0.02, 0.25) * width, rng.uniform(0.05, 0.4) * width
    angle, unruly = rng.uniform(0, 2 * np.pi), rng.choice([0.1, 0.4, 2.0])
    colours = [_tone(rng).tolist() for _ in range(2)]
    steps = np.linspace(0.0, 1.0, 8)[:, None]
    for _ in range(int(rng.integers(10, 70))):
        start = middle + rng.normal(0.0, spread, 2)
        along = angle + rng.normal(0.0, unruly)
        ahead = np.array([np.cos(along), np.sin(along)]) * length * rng.uniform(0.4, 1.0)
        bend = np.array([-ahead[1], ahead[0]]) * rng.normal(0.0, 0.5)
        points = start + steps * ahead + steps * (1 - steps) * bend
        thickness, colour = int(rng.integers(1, 4)), colours[rng.integers(2)]
        line = [points.astype(np.int32)]
        cv2.polylines(
            canvas, line, isClosed=False, color=colour, thickness=thickness, lineType=cv2.LINE_AA
        )


def _pieces(canvas: Picture, rng: np.random.Generator) -> None:
    """Heap up many pieces of nearly one colour with light and dark sides: food, leaves, gravel."""
    height, width = canvas.shape[:2]
    middle, spread = rng.uniform((0, 0), (width, height)), rng.uniform(0.04, 0.3) * width
    tone, size, slim = _tone(rng), rng.uniform(2.0, 22.0), rng.uniform(0.15, 1.0)
    for _ in range(int(rng.integers(20, 160))):
        u, v = (middle + rng.normal(0.0, spread, 2)).astype(int).tolist()
        axes = (int(size * rng.uniform(0.5, 1.2)) + 1, int(size * slim) + 1)
        turn, shade = rng.uniform(0, 360), rng.uniform(0.5, 1.2)
        for side, light in ((0, 0.6), (int(size / 5) + 1, 1.0)):
            colour = np.clip(tone * shade * light, 0, 255).tolist()
            cv2.ellipse(canvas, (u - side, v - side), axes, turn, 0, 360, colour, -1, cv2.LINE_AA)


def _line(
    canvas: Picture,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    colour: list[float],
    thickness: int,
) -> None:
    first, last = (int(start[0]), int(start[1])), (int(end[0]), int(end[1]))
    cv2.line(canvas, first, last, colour, thickness, cv2.LINE_AA)


_DRAWN = (_grid, _grid, _twigs, _twigs, _letters, _chessboard, _ribs, _strands, _pieces)


def compose(picture: Picture, wanted: NDArray[np.bool_], rng: np.random.Generator) -> Picture:
    """Change a picture around the `wanted` pixels, their texture, and the light on all.

    `wanted` (height, width) are the pixels of what is labelled.
    """
    shape = picture.shape[:2]
    result = picture.astype(np.float32)
    mask = cv2.GaussianBlur(wanted.astype(np.float32), (3, 3), 0)[..., None]
    choice = rng.random()
    if choice < 0.45:  # noqa: PLR2004 - a large share, wholly or from some height down or up
        behind = backdrop(shape, rng).astype(np.float32)
        keep = mask
        if choice < 0.15:  # noqa: PLR2004
            patch = field(shape, rng.uniform(2, 5), rng)
            keep = np.maximum(mask, (patch > rng.uniform(-0.8, 0.8)).astype(np.float32)[..., None])
        result = result * keep + behind * (1.0 - keep)
    if rng.random() < 0.6:  # noqa: PLR2004 - folds of cloth, dirt, reflections
        folds = rng.uniform(0, 0.22) * field(shape, rng.uniform(10, 60), rng)
        folds += rng.uniform(0, 0.16) * field(shape, rng.uniform(60, 200), rng)
        result *= 1.0 + mask * folds[..., None]
    if rng.random() < 0.3:  # noqa: PLR2004 - light through leaves
        light = field(shape, rng.uniform(3, 14), rng)
        edge = np.clip((light - rng.uniform(-0.5, 0.7)) * rng.uniform(1.5, 6), 0, 1)
        dark, bright = rng.uniform(0.25, 0.8), rng.uniform(1.0, 1.7)
        result *= (dark + (bright - dark) * edge)[..., None]
    return np.clip(result, 0, 255).astype(np.uint8)
