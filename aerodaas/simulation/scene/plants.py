"""Trees and crops."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from panda3d.core import NodePath

from aerodaas.simulation.scenario import CropRows
from aerodaas.simulation.scene.layers import attach
from aerodaas.simulation.scene.light import Light
from aerodaas.simulation.scene.mesh import Mesh, blob, merged, sheet, tube
from aerodaas.simulation.scene.textures import Palette
from aerodaas.simulation.world import CROWN_SHARE, Thing

__all__ = ["add_crops", "add_tree"]

_SEGMENT = 2.5
"""Metres of a row between changes of its height."""

_LEAN = 0.45
"""Radians by which the two strips of a row lean apart, so that they cover from above too."""


def rng_of(thing: Thing) -> np.random.Generator:
    """Generator of a thing's looks, the same in every process."""
    return np.random.default_rng(list(thing.seed.encode()))


def add_tree(parent: NodePath, thing: Thing, palette: Palette, light: Light) -> None:
    """Attach a broad-leaved tree: a trunk, and a crown of bulging clumps of leaves."""
    rng, height = rng_of(thing), thing.height
    radius, middle = CROWN_SHARE * height, 0.64 * height
    girth = 0.035 * height
    trunk = tube([1.5 * girth, girth, 0.75 * girth], [0, 0.12 * height, middle], sides=7)
    trunk = Mesh(trunk.points, trunk.uv * (2, 3), trunk.normals, trunk.colours, trunk.triangles)
    place = (thing.x, thing.y, 0.0)
    attach(parent, "trunk", trunk.moved(place).lit(light.sun), palette["bark"])
    clumps = [_clump((0, 0, middle), 0.72 * radius, rng)]
    for k in range(5):
        angle = math.tau * k / 5 + rng.uniform(-0.3, 0.3) + thing.yaw
        out, up = 0.48 * radius, rng.uniform(-0.18, 0.30) * radius
        centre = (out * math.cos(angle), out * math.sin(angle), middle + up)
        clumps.append(_clump(centre, rng.uniform(0.46, 0.56) * radius, rng))
    crown = merged(clumps).moved(place).lit(light.sun)
    low = (crown.points[:, 2] - middle) / radius
    tint = rng.uniform(0.8, 1.2) * np.array([rng.uniform(0.85, 1.25), 1.0, rng.uniform(0.7, 1.1)])
    shaded = crown.painted(1.12 * tint).painted(np.clip(0.86 + 0.35 * low, 0.5, 1.25)[:, None])
    attach(parent, "crown", shaded, palette["leaves"], cutout=True, both_sides=True)


def _clump(centre: tuple[float, float, float], radius: float, rng: np.random.Generator) -> Mesh:
    ball = blob(radius, rings=7, sides=9, repeat=3.0)
    bumps = 1.0 + 0.16 * _bumps(ball.normals, rng)
    points = ball.points * bumps[:, None] * (1.0, 1.0, 0.85)
    return Mesh(points, ball.uv, ball.normals, ball.colours, ball.triangles).moved(centre)


def _bumps(normals: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Smooth random field over a sphere, the same where its seam meets."""
    waves = rng.normal(size=(6, 3)) * 2.2
    phases = rng.uniform(0, math.tau, 6)
    return np.asarray(np.sin(normals @ waves.T + phases).mean(axis=1) * 1.6)


def add_crops(parent: NodePath, thing: Thing, palette: Palette, light: Light) -> None:
    """Attach the plants of a field, one node per row."""
    spec = thing.spec
    if not isinstance(spec, CropRows):
        raise TypeError(f"{thing.id} is no field")
    rng = rng_of(thing)
    west, south, east, north = spec.area
    for y in np.arange(south + spec.spacing / 2, north, spec.spacing):
        cuts = np.arange(west, east + 1e-6, _SEGMENT)
        heights = spec.height * rng.uniform(0.8, 1.2, len(cuts))
        tones = rng.uniform(0.85, 1.12, len(cuts))
        parts = []
        for i in range(len(cuts) - 1):
            for lean in (-_LEAN, _LEAN):
                parts.append(_strip(cuts[i : i + 2], y, heights[i : i + 2], lean, rng.uniform()))
                parts[-1] = parts[-1].painted(tones[i : i + 1])
        row = merged(parts).lit(light.sun)
        attach(parent, "row", row, palette["crop"], cutout=True, both_sides=True)


def _strip(
    ends: NDArray[np.float64], y: float, heights: NDArray[np.float64], lean: float, shift: float
) -> Mesh:
    """One leaning strip of plants along x; the light falls on it as on level ground."""
    across, up = math.sin(lean) * heights, math.cos(lean) * heights
    foot = -0.25 * across
    corners = [
        (ends[0], y + foot[0], 0.0),
        (ends[1], y + foot[1], 0.0),
        (ends[1], y + across[1], up[1]),
        (ends[0], y + across[0], up[0]),
    ]
    u = ends / 2.0 + shift
    plain = sheet(corners, [(u[0], 0.01), (u[1], 0.01), (u[1], 0.98), (u[0], 0.98)])
    tint = np.array([0.75, 0.75, 1.15, 1.15])[:, None]
    level = np.tile([0.0, 0.0, 1.0], (4, 1))
    return Mesh(plain.points, plain.uv, level, plain.colours * tint, plain.triangles)
