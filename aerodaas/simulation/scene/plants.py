"""Scene nodes of trees and crops."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from panda3d.core import LODNode, NodePath

from aerodaas.simulation.scenario import CropRows
from aerodaas.simulation.scene.layers import attach
from aerodaas.simulation.scene.light import Light
from aerodaas.simulation.scene.mesh import Mesh, blob, merged, sheet, tube
from aerodaas.simulation.scene.textures import Palette
from aerodaas.simulation.world import (
    CROWN_SHARE,
    LEAF_FLATNESS,
    TRUNK_SHARE,
    Thing,
    crown_clumps,
    rng_of,
)

__all__ = ["add_crops", "add_tree"]

_SEGMENT = 2.5
"""Length of a row's segments of different height, metres."""

_LEAN = 0.45
"""Lean of a row's two strips in radians, so that they also cover the ground from above."""


_NEAR, _FAR = 22.0, 2000.0
"""Distances in metres up to which a tree is rendered in detail, and at all."""


def add_tree(parent: NodePath, thing: Thing, palette: Palette, light: Light) -> None:
    """Attach a broad-leaved tree: a trunk, and a crown of clumps of leaves.

    Args:
        parent: Node of the scene to which it is attached.
        thing: The object, with its specification, place and seed.
        palette: Textures by name.
        light: Sun and sky of the scene.
    """
    rng, height = rng_of(thing), thing.height
    radius, middle = CROWN_SHARE * height, 0.62 * height
    girth = TRUNK_SHARE * height
    trunk = tube([1.5 * girth, girth, 0.75 * girth], [0, 0.12 * height, middle], sides=7)
    trunk = Mesh(trunk.points, trunk.uv * (2, 3), trunk.normals, trunk.colours, trunk.triangles)
    place = (thing.x, thing.y, 0.0)
    attach(parent, "trunk", trunk.moved(place).lit(light.sun), palette["bark"])
    clumps = _clumps(thing, rng)
    tint = rng.uniform(0.85, 1.2) * np.array([rng.uniform(0.85, 1.2), 1.0, rng.uniform(0.7, 1.1)])
    detail = LODNode("crown")
    levels = parent.attach_new_node(detail)
    levels.set_pos(*place)
    for near, far, rings, sides in ((0.0, _NEAR, 7, 9), (_NEAR, _FAR, 5, 6)):
        crown = merged([_ball(clump, rings, sides) for clump in clumps]).lit(light.sun)
        low = (crown.points[:, 2] - middle) / radius
        crown = crown.painted(tint).painted(np.clip(0.9 + 0.3 * low, 0.55, 1.3)[:, None])
        node = attach(levels, "crown", crown, palette["leaves"], cutout=True)
        node.set_two_sided(near <= 0.0)
        detail.add_switch(far, near)


@dataclass(frozen=True)
class _Clump:
    """A clump of leaves, a sphere with bumps."""

    centre: tuple[float, float, float]
    radius: float
    waves: NDArray[np.float64]
    phases: NDArray[np.float64]


def _clumps(thing: Thing, rng: np.random.Generator) -> list[_Clump]:
    return [
        _Clump(centre, radius, 2.2 * rng.normal(size=(6, 3)), rng.uniform(0, math.tau, 6))
        for centre, radius in crown_clumps(thing, rng)
    ]


def _ball(clump: _Clump, rings: int, sides: int) -> Mesh:
    """Mesh of a clump; a coarser one has the same shape with fewer faces."""
    ball = blob(clump.radius, rings=rings, sides=sides, repeat=3.0)
    # Waves are functions of the sphere's normals, and so are continuous at its seam.
    bumps = 1.0 + 0.25 * np.sin(ball.normals @ clump.waves.T + clump.phases).mean(axis=1)
    points = ball.points * bumps[:, None] * (1.0, 1.0, LEAF_FLATNESS)
    return Mesh(points, ball.uv, ball.normals, ball.colours, ball.triangles).moved(clump.centre)


def add_crops(parent: NodePath, thing: Thing, palette: Palette, light: Light) -> None:
    """Attach the plants of a field, one node per row.

    Args:
        parent: Node of the scene to which it is attached.
        thing: The object, with its specification, place and seed.
        palette: Textures by name.
        light: Sun and sky of the scene.
    """
    spec = thing.spec
    if not isinstance(spec, CropRows):
        raise TypeError(f"{thing.id} is no field")
    rng = rng_of(thing)
    west, south, east, north = spec.area
    for y in np.arange(south + spec.spacing / 2, north, spec.spacing).tolist():
        cuts = np.linspace(west, east, 1 + max(1, round((east - west) / _SEGMENT))).tolist()
        heights = (spec.height * rng.uniform(0.8, 1.2, len(cuts))).tolist()
        tones = rng.uniform(0.85, 1.12, len(cuts))
        parts = []
        for i in range(len(cuts) - 1):
            for lean in (-_LEAN, _LEAN):
                ends, tall = (cuts[i], cuts[i + 1]), (heights[i], heights[i + 1])
                parts.append(_strip(ends, y, tall, lean, rng.uniform()).painted(tones[i]))
        row = merged(parts).lit(light.sun)
        attach(parent, "row", row, palette["crop"], cutout=True, both_sides=True)


def _strip(
    ends: tuple[float, float], y: float, heights: tuple[float, float], lean: float, shift: float
) -> Mesh:
    """One leaning strip of plants along x, lit as level ground."""
    across, up = math.sin(lean), math.cos(lean)
    foot = y - 0.25 * across * heights[0]
    corners = [
        (ends[0], foot, 0.0),
        (ends[1], foot, 0.0),
        (ends[1], y + across * heights[1], up * heights[1]),
        (ends[0], y + across * heights[0], up * heights[0]),
    ]
    u, v = ends[0] / 2.0 + shift, ends[1] / 2.0 + shift
    plain = sheet(corners, [(u, 0.01), (v, 0.01), (v, 0.98), (u, 0.98)])
    tint = np.array([0.75, 0.75, 1.15, 1.15])[:, None]
    level = np.tile([0.0, 0.0, 1.0], (4, 1))
    return Mesh(plain.points, plain.uv, level, plain.colours * tint, plain.triangles)
