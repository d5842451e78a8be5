"""Scene nodes of heaps of broken masonry."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from panda3d.core import NodePath

from aerodaas.geometry.frames import rotation_from_rpy
from aerodaas.simulation.scenario import Rubble
from aerodaas.simulation.scene.layers import attach
from aerodaas.simulation.scene.light import Light
from aerodaas.simulation.scene.mesh import Mesh, box, merged
from aerodaas.simulation.scene.textures import Palette
from aerodaas.simulation.world import Thing, rng_of

__all__ = ["add_rubble"]

_PIECES_PER_SQUARE_METRE = 2.5
_MOST_PIECES = 60
_TILT = 0.7
"""Greatest tilt of a piece, radians."""

_STUFFS = (("brick", 0.5), ("plaster", 0.3), ("wood", 0.2))
"""Textures of the pieces and their frequencies."""


def add_rubble(parent: NodePath, thing: Thing, palette: Palette, light: Light) -> None:
    """Attach scattered slabs and blocks, more and higher towards the middle.

    Args:
        parent: Node of the scene to which it is attached.
        thing: The object, with its specification, place and seed.
        palette: Textures by name.
        light: Sun and sky of the scene.
    """
    spec = thing.spec
    if not isinstance(spec, Rubble):
        raise TypeError(f"{thing.id} is no rubble")
    rng = rng_of(thing)
    length, width, _ = spec.size
    count = min(_MOST_PIECES, max(6, round(_PIECES_PER_SQUARE_METRE * length * width)))
    home = parent.attach_new_node(spec.id)
    home.set_pos(thing.x, thing.y, 0.0)
    home.set_h(math.degrees(thing.yaw))
    names = [name for name, _ in _STUFFS]
    chosen = rng.choice(len(_STUFFS), count, p=[share for _, share in _STUFFS])
    for stuff in np.unique(chosen):
        pieces = [_piece(spec, rng) for _ in range(int((chosen == stuff).sum()))]
        mesh = merged(pieces).lit(light.sun)
        attach(home, names[stuff], mesh, palette[names[stuff]], both_sides=True)


def _piece(spec: Rubble, rng: np.random.Generator) -> Mesh:
    """One slab inside the heap's half ellipsoid."""
    length, width, height = spec.size
    size = rng.uniform((0.3, 0.2, 0.08), (1.1, 0.7, 0.35)) * min(1.0, height)
    reach = max(float(np.hypot(*size[:2])), float(size[2]))
    angle, radius = rng.uniform(0, math.tau), math.sqrt(rng.uniform(0.0, 1.0))
    slope = math.sqrt(max(0.0, 1.0 - radius * radius))
    x = math.cos(angle) * radius * (length - reach) / 2
    y = math.sin(angle) * radius * (width - reach) / 2
    z = rng.uniform(0.0, 1.0) * slope * max(0.0, height - reach)
    roll, pitch = rng.uniform(-_TILT, _TILT, 2)
    turn = rotation_from_rpy(roll, pitch, rng.uniform(-math.pi, math.pi))
    slab = _turned(box(size, texel=1.2, bottom=True), turn)
    return slab.painted(rng.uniform(0.55, 1.05)).moved((x, y, z))


def _turned(mesh: Mesh, turn: NDArray[np.float64]) -> Mesh:
    return replace(mesh, points=mesh.points @ turn.T, normals=mesh.normals @ turn.T)
