"""Things that a detector must not take for what it looks for."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from panda3d.core import NodePath

from aerodaas.simulation.scene.layers import attach
from aerodaas.simulation.scene.mesh import Mesh, blob, box, merged, tube
from aerodaas.simulation.scene.textures import Palette
from tools.training.looks import any_colour, hi_vis

__all__ = ["add_clutter"]

_TEXTURES = ("plain", "plain", "plaster", "brick", "wood", "gravel", "leaves", "tiles", "asphalt")
_SUN = np.array([0.4, 0.2, 0.89])


def add_clutter(
    parent: NodePath, palette: Palette, place: tuple[float, float], rng: np.random.Generator
) -> None:
    """Attach a cone, post, sign, heap, bush, wall, machine or bin at an ENU `place`."""
    kinds = (_cone, _post, _sign, _heap, _bush, _wall, _machine, _bin)
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
