"""Things that a detector must not take for what it looks for."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray
from panda3d.core import NodePath

from aerodaas.simulation.scene.buildings import beam
from aerodaas.simulation.scene.layers import attach
from aerodaas.simulation.scene.mesh import Mesh, blob, box, merged, tube
from aerodaas.simulation.scene.textures import Palette
from tools.training.colours import any_colour, hi_vis

__all__ = ["add_clutter"]

_TEXTURES = ("plain", "plain", "plaster", "brick", "wood", "gravel", "leaves", "tiles", "asphalt")
_SUN = np.array([0.4, 0.2, 0.89])
_GARISH_SHARE = 0.65
"""Of things that may be garish, the others being of bars."""


def add_clutter(
    parent: NodePath, palette: Palette, place: tuple[float, float], rng: np.random.Generator
) -> None:
    """Attach something garish, or something of bars, at an ENU `place`.

    The former tempts a detector of vests, the latter one of towers.
    """
    kinds = _GARISH if rng.random() < _GARISH_SHARE else _BARRED
    mesh = kinds[rng.integers(len(kinds))](rng)
    mesh = mesh.moved((*place, 0.0), rng.uniform(-math.pi, math.pi)).lit(_SUN)
    texture = palette[_TEXTURES[rng.integers(len(_TEXTURES))]]
    attach(parent, "clutter", mesh, texture, both_sides=True)


def _colour(rng: np.random.Generator) -> NDArray[np.float64]:
    """Garish as often as not: these are what tempts a vest detector."""
    return np.array(hi_vis(rng) if rng.integers(2) else any_colour(rng))


def _cone(rng: np.random.Generator) -> Mesh:
    tall, colour = rng.uniform(0.4, 1.0), _colour(rng)
    parts = [box((0.4, 0.4, 0.04)).painted(colour)]
    levels = np.linspace(0.0, tall, 6)
    radii = np.linspace(0.17, 0.03, 6)
    for k in range(5):
        white = k in (2, 3) and rng.integers(2)
        part = tube(radii[k : k + 2], levels[k : k + 2], sides=8)
        parts.append(part.painted((0.95, 0.95, 0.95) if white else colour))
    return merged(parts)


def _post(rng: np.random.Generator) -> Mesh:
    """A pole, plain or striped, some with arms."""
    tall, girth = rng.uniform(1.0, 9.0), rng.uniform(0.03, 0.3)
    colours = _colour(rng), np.array(any_colour(rng))
    steps = int(rng.integers(1, 9))
    levels = np.linspace(0.0, tall, steps + 1)
    parts = [
        tube([girth, girth], levels[k : k + 2], sides=7).painted(colours[k % 2])
        for k in range(steps)
    ]
    for _ in range(rng.integers(3)):
        arm = box((rng.uniform(0.3, 2.0), 0.08, rng.uniform(0.05, 0.6)), bottom=True)
        arm = arm.moved((rng.uniform(-0.5, 0.5), 0.0, rng.uniform(0.4, 1.0) * tall))
        parts.append(arm.painted(_colour(rng)))
    return merged(parts)


def _sign(rng: np.random.Generator) -> Mesh:
    wide, tall, up = rng.uniform(0.3, 1.5), rng.uniform(0.3, 1.2), rng.uniform(0.3, 2.4)
    pole = tube([0.03, 0.03], [0.0, up + tall], sides=5).painted(any_colour(rng))
    board = box((0.03, wide, tall), bottom=True).moved((0.05, 0, up)).painted(_colour(rng))
    parts = [pole, board]
    for _ in range(rng.integers(4)):
        stripe = box((0.05, wide * rng.uniform(0.1, 1.0), tall * rng.uniform(0.05, 0.2)))
        stripe = stripe.moved((0.05, 0.0, up + tall * rng.uniform(0.0, 0.8)))
        parts.append(stripe.painted(any_colour(rng)))
    return merged(parts)


def _heap(rng: np.random.Generator) -> Mesh:
    parts = []
    for _ in range(rng.integers(2, 9)):
        size = rng.uniform(0.15, 1.2, 3)
        place = (*rng.uniform(-1.2, 1.2, 2), rng.uniform(0, 0.6))
        part = box(size, bottom=True).moved(place, rng.uniform(0, 6))
        parts.append(part.painted(_colour(rng)))
    return merged(parts)


def _bush(rng: np.random.Generator) -> Mesh:
    """Leaves or flowers; yellow ones, too."""
    parts = []
    for _ in range(rng.integers(2, 7)):
        radius = rng.uniform(0.2, 0.8)
        green = np.array([rng.uniform(0.2, 1.0), rng.uniform(0.4, 1.0), rng.uniform(0.05, 0.4)])
        place = (*rng.uniform(-0.8, 0.8, 2), radius * rng.uniform(0.3, 1.0))
        parts.append(blob(radius, rings=5, sides=7).moved(place).painted(green))
    return merged(parts)


def _wall(rng: np.random.Generator) -> Mesh:
    size = (rng.uniform(2, 14), rng.uniform(0.2, 0.5), rng.uniform(0.4, 2.6))
    return box(size, texel=rng.uniform(0.8, 2.0)).painted(_colour(rng))


def _machine(rng: np.random.Generator) -> Mesh:
    """Wheels below boxes: carts, motorcycles, tractors, diggers."""
    long, wide = rng.uniform(0.8, 3.2), rng.uniform(0.15, 1.6)
    radius = rng.uniform(0.2, 0.7)
    parts = []
    for x in (-long / 2, long / 2):
        for y in (-wide / 2, wide / 2):
            drum = tube([radius, radius, 0.01], [0.0, 0.1, 0.101], sides=10)
            points = drum.points[:, [0, 2, 1]] + np.array([x, y, radius])
            dark = np.full(3, rng.uniform(0.02, 0.2))
            parts.append(
                Mesh(points, drum.uv, drum.normals, drum.colours, drum.triangles).painted(dark)
            )
    colour = _colour(rng)
    for _ in range(rng.integers(1, 5)):
        size = np.array([long, wide, 0.8]) * rng.uniform(0.2, 1.0, 3)
        place = (rng.uniform(-0.3, 0.3) * long, 0.0, radius * rng.uniform(0.6, 2.0))
        tint = colour if rng.integers(2) else any_colour(rng)
        parts.append(box(size, bottom=True).moved(place).painted(tint))
    return merged(parts)


def _bin(rng: np.random.Generator) -> Mesh:
    tall, girth = rng.uniform(0.4, 1.2), rng.uniform(0.15, 0.45)
    drum = tube([girth, girth * rng.uniform(0.8, 1.1), 0.01], [0.0, tall, tall + 0.01], sides=9)
    band = tube([girth * 1.1] * 2, [0.4 * tall, 0.55 * tall], sides=9).painted(any_colour(rng))
    return merged([drum.painted(_colour(rng)), band])


def _parasol(rng: np.random.Generator) -> Mesh:
    """An umbrella or a parasol, of one colour or two in turn, its ribs showing."""
    wide, up, sides = rng.uniform(0.4, 1.6), rng.uniform(1.2, 2.4), int(rng.integers(6, 11))
    canopy = tube([wide, 0.6 * wide, 0.02], [up, up + 0.3 * wide, up + 0.45 * wide], sides=sides)
    colours = _colour(rng), np.array(any_colour(rng))
    slices = np.arange(len(canopy.points)) % (sides + 1) % 2
    second = rng.integers(2) * slices[:, None]
    canopy = canopy.painted(np.where(second, colours[1], colours[0]))
    return merged([canopy, tube([0.02, 0.02], [0.0, up], sides=4).painted(any_colour(rng))])


def _bare_tree(rng: np.random.Generator) -> Mesh:
    """A trunk and its branches, without leaves."""
    shade = rng.uniform(0.03, 0.5)
    parts, ends = [], [(np.zeros(3), np.array([0.0, 0.0, 1.0]), rng.uniform(0.8, 2.5))]
    girth = rng.uniform(0.05, 0.2)
    for depth in range(int(rng.integers(3, 5))):
        grown = []
        for start, along, reach in ends:
            end = start + along * reach
            parts.append(beam(start, end, girth * 0.6**depth, 3))
            for _ in range(3 if depth else 4):
                turned = along + rng.normal(0.0, 0.45, 3) + (0.0, 0.0, 0.1)
                turned /= np.linalg.norm(turned)
                grown.append((end, turned, reach * rng.uniform(0.5, 0.9)))
        ends = grown
    return merged(parts).painted((shade, shade * rng.uniform(0.8, 1.0), shade * 0.8))


def _frame(rng: np.random.Generator) -> Mesh:
    """Upright bars and level ones, without the braces of a lattice: scaffolds, racks, goals."""
    bays, storeys = int(rng.integers(1, 5)), int(rng.integers(1, 6))
    wide, tall, deep = rng.uniform(0.5, 2.5), rng.uniform(0.4, 2.2), rng.uniform(0.3, 1.5)
    girth, colour = rng.uniform(0.012, 0.05), _colour(rng)
    parts = []
    for x in np.arange(bays + 1) * wide:
        parts += [beam((x, y, 0.0), (x, y, storeys * tall), girth, 3) for y in (0.0, deep)]
    for level in np.arange(1, storeys + 1) * tall:
        ends = [((0.0, y, level), (bays * wide, y, level)) for y in (0.0, deep)]
        parts += [beam(start, end, girth, 3) for start, end in ends]
        if rng.integers(2):
            board = box((bays * wide, deep, 0.05), bottom=True)
            parts.append(board.moved((bays * wide / 2, deep / 2, level)))
    return merged(parts).painted(colour)


def _mast(rng: np.random.Generator) -> Mesh:
    """A pole with arms, wires to the next one, perhaps a ladder: power lines, lamps, ships."""
    tall, girth = rng.uniform(4.0, 14.0), rng.uniform(0.05, 0.2)
    far = rng.uniform(8.0, 30.0)
    arms = rng.uniform(0.6, 1.0, int(rng.integers(1, 4))) * tall
    parts = [tube([girth, 0.6 * girth], [0.0, tall], sides=6)]
    parts.append(parts[0].moved((0.0, far, 0.0)))
    for level in arms:
        reach = rng.uniform(0.2, 1.5)
        parts += [beam((-reach, y, level), (reach, y, level), 0.05, 3) for y in (0.0, far)]
        for x in (-reach, reach):
            middle = (x, far / 2, level - 0.03 * far)
            parts += [
                beam((x, 0, level), middle, 0.012, 3),
                beam(middle, (x, far, level), 0.012, 3),
            ]
    if rng.integers(2):
        rungs = np.arange(0.4, 0.8 * tall, 0.4)
        parts += [beam((0.0, -0.25, level), (0.0, 0.25, level), 0.02, 3) for level in rungs]
    return merged(parts).painted(any_colour(rng))


def _chair(rng: np.random.Generator) -> Mesh:
    """Legs, a seat and a back of bars: chairs, tables, trolleys, ladders."""
    wide, seat, tall = rng.uniform(0.35, 1.2), rng.uniform(0.4, 0.8), rng.uniform(0.7, 1.4)
    girth, colour = rng.uniform(0.01, 0.03), _colour(rng)
    parts = [box((wide, wide, 0.04), bottom=True).moved((0, 0, seat))]
    for x, top in ((-wide / 2, seat), (wide / 2, tall)):
        parts += [beam((x, y, 0.0), (x, y, top), girth, 3) for y in (-wide / 2, wide / 2)]
    for share in np.linspace(0.2, 1.0, int(rng.integers(2, 6))):
        level = seat + share * (tall - seat)
        parts.append(beam((wide / 2, -wide / 2, level), (wide / 2, wide / 2, level), girth, 3))
    return merged(parts).painted(colour)


def _wheel(rng: np.random.Generator) -> Mesh:
    """Two wheels with spokes and a frame: a bicycle."""
    radius, apart = rng.uniform(0.25, 0.4), rng.uniform(0.8, 1.2)
    parts = []
    for x in (0.0, apart):
        hub = np.array([x, 0.0, radius])
        angles = np.linspace(0.0, math.tau, 15)
        rim = hub + radius * np.stack([np.cos(angles), 0 * angles, np.sin(angles)], -1)
        parts += [beam(a, b, 0.02, 3) for a, b in itertools.pairwise(rim)]
        parts += [beam(hub, point, 0.004, 3) for point in rim[:-1]]
    joints = np.array([(0, 0, radius), (0.3 * apart, 0, 0.9), (0.45 * apart, 0, 0.3)])
    joints = np.vstack([joints, [(0.85 * apart, 0, 0.95), (apart, 0, radius)]])
    bars = ((0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (3, 4))
    colour = _colour(rng)
    parts += [beam(joints[a], joints[b], 0.022, 4).painted(colour) for a, b in bars]
    return merged(parts)


_GARISH = (_cone, _post, _sign, _heap, _bush, _wall, _machine, _bin, _parasol)
_BARRED = (_bare_tree, _bare_tree, _frame, _mast, _chair, _wheel)
