"""Scene nodes of buildings, fences and lattice towers."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from panda3d.core import NodePath

from aerodaas.simulation.scenario import Building, Fence, Tower
from aerodaas.simulation.scene.layers import LABEL, attach
from aerodaas.simulation.scene.light import Light
from aerodaas.simulation.scene.mesh import Mesh, box, merged, sheet, tube
from aerodaas.simulation.scene.textures import Palette
from aerodaas.simulation.world import EAVES, ROOF_RISE, TOWER_TAPER, Thing, rng_of

__all__ = ["TowerLook", "add_building", "add_fence", "add_tower", "beam"]

_BAY = 3.0
"""Length of a plastered wall per window, metres."""

_PROUD = 0.03
"""Protrusion of windows and doors from their wall, metres."""

_BARN_LENGTH = 12.0
"""Length in metres above which a wooden building is a barn, with a gate."""

_BESIDE_DOOR = 0.9
"""Least distance between a door and the middle of the next window, metres."""

_FRAME = (0.90, 0.89, 0.86)
_TILED_SHARE = 0.6
"""Fraction of clay roofs; the others are of slate."""

_WOODS = ((1.0, 0.95, 0.9), (0.75, 0.42, 0.36), (0.8, 0.85, 0.85))
_PLASTERS = ((1.0, 0.97, 0.90), (0.98, 0.90, 0.74), (0.86, 0.90, 0.92), (0.95, 0.82, 0.76))


def add_building(parent: NodePath, thing: Thing, palette: Palette, light: Light) -> None:
    """Attach a building with its roof, windows and a door.

    Args:
        parent: Node of the scene to which it is attached.
        thing: The object, with its specification, place and seed.
        palette: Textures by name.
        light: Sun and sky of the scene.
    """
    spec = thing.spec
    if not isinstance(spec, Building):
        raise TypeError(f"{thing.id} is no building")
    rng = rng_of(thing)
    walls = spec.walls or str(rng.choice(["brick", "plaster", "wood"]))
    length, width, height = spec.size
    home = parent.attach_new_node(spec.id)
    home.set_pos(thing.x, thing.y, 0.0)
    home.set_h(math.degrees(thing.yaw))
    sun = _turned(light.sun, -thing.yaw)
    tint: ArrayLike = 1.0
    if walls == "plaster":
        tint = _PLASTERS[rng.integers(len(_PLASTERS))]
        body = _facade(spec)
    else:
        tint = _WOODS[rng.integers(len(_WOODS))] if walls == "wood" else 1.0
        body = box(spec.size, texel=1.6)
    parts = [body]
    if spec.roof == "gable":
        parts.append(_gables(length, width, height))
    texture = palette["facade" if walls == "plaster" else walls]
    attach(home, "walls", merged(parts).painted(tint).lit(sun), texture)
    roof = _gable_roof(length, width, height) if spec.roof == "gable" else _flat_roof(spec)
    slate = (1.0, 1.0, 1.0) if rng.random() < _TILED_SHARE else (0.55, 0.62, 0.72)
    cover = palette["tiles" if spec.roof == "gable" else "gravel"]
    attach(home, "roof", roof.painted(slate).lit(sun), cover, both_sides=True)
    attach(home, "openings", _openings(spec, walls).lit(sun), palette["plain"])
    home.flatten_light()


def _turned(vector: NDArray[np.float64], yaw: float) -> NDArray[np.float64]:
    c, s = math.cos(yaw), math.sin(yaw)
    x, y, z = vector
    return np.array([c * x - s * y, s * x + c * y, z])


def _facade(spec: Building) -> Mesh:
    """Walls whose texture repeats once per bay and storey."""
    length, width, height = spec.size
    body = box(spec.size)
    storeys = max(1, round(height / _BAY))
    scale = np.ones_like(body.uv)
    bays = [max(1, round(extent / _BAY)) / extent for extent in (length, width, length, width)]
    for side, share in enumerate(bays):
        scale[4 * side : 4 * side + 4] = (share, storeys / height)
    scale[16:] = 0.0
    return Mesh(body.points, body.uv * scale, body.normals, body.colours, body.triangles)


def _gables(length: float, width: float, height: float) -> Mesh:
    rise = ROOF_RISE * width / 2
    x, y = length / 2, width / 2
    parts = []
    for side in (-1.0, 1.0):
        points = np.array(
            [
                (side * x, -side * y, height),
                (side * x, side * y, height),
                (side * x, 0, height + rise),
            ]
        )
        normal = np.tile([side, 0.0, 0.0], (3, 1))
        uv = points[:, 1:] / 1.6 * (1.0, 0.02)
        parts.append(Mesh(points, uv, normal, np.ones((3, 3)), np.array([[0, 1, 2]])))
    return merged(parts)


def _gable_roof(length: float, width: float, height: float) -> Mesh:
    slope = ROOF_RISE
    x, y = length / 2 + EAVES, width / 2 + EAVES
    ridge, eaves = height + slope * width / 2 + 0.04, height - slope * EAVES + 0.04
    run = math.hypot(y, ridge - eaves)
    uv = np.array([(0, 0), (2 * x, 0), (2 * x, run), (0, run)]) / 2.2
    south = sheet([(-x, -y, eaves), (x, -y, eaves), (x, 0, ridge), (-x, 0, ridge)], uv)
    north = sheet([(x, y, eaves), (-x, y, eaves), (-x, 0, ridge), (x, 0, ridge)], uv)
    return merged([south, north])


def _flat_roof(spec: Building) -> Mesh:
    length, width, height = spec.size
    return box((length + 0.3, width + 0.3, 0.35), texel=2.0, bottom=True).moved(
        (0, 0, height - 0.3)
    )


def _openings(spec: Building, walls: str) -> Mesh:
    """A door on the south side and windows around, which the plaster texture already contains."""
    length, width, height = spec.size
    barn = walls == "wood" and length > _BARN_LENGTH
    door_width, tall = (3.2, 3.2) if barn else (1.1, 2.1)
    door = _Opening(0.0, door_width, 0.0, min(tall, 0.82 * height), (0.38, 0.27, 0.19))
    parts = list(_framed(door, -width / 2, 0.0))
    if walls == "plaster":
        return merged(parts)
    sides = ((length, width), (width, length), (length, width), (width, length))
    for side, (extent, reach) in enumerate(sides):
        count = int(extent // _BAY)
        for k in range(count):
            along = (k + 0.5 - count / 2) * _BAY
            if side > 0 or abs(along) > door_width / 2 + _BESIDE_DOOR:
                low = 0.38 * height
                high = low + min(1.3, 0.4 * height)
                window = _Opening(along, 1.1, low, high, (0.24, 0.31, 0.38))
                parts += _framed(window, -reach / 2, side * math.pi / 2)
    return merged(parts)


@dataclass(frozen=True)
class _Opening:
    """A door or window: position along its wall, width, lower and upper edge, colour."""

    along: float
    width: float
    low: float
    high: float
    colour: tuple[float, float, float]


def _framed(opening: _Opening, wall: float, turn: float) -> list[Mesh]:
    """A framed pane on the south `wall`, rotated about the building's centre."""
    half, rim = opening.width / 2, 0.09
    result = []
    for out, margin, colour in ((_PROUD, rim, _FRAME), (2.5 * _PROUD, 0.0, opening.colour)):
        west, east = opening.along - half - margin, opening.along + half + margin
        low, high, y = max(0.0, opening.low - margin), opening.high + margin, wall - out
        corners = [(west, y, low), (east, y, low), (east, y, high), (west, y, high)]
        result.append(sheet(corners).painted(colour).moved((0, 0, 0), turn))
    return result


def beam(start: ArrayLike, end: ArrayLike, radius: float, sides: int = 4) -> Mesh:
    """A bar from one point to another.

    Args:
        start: Centre of one end, metres.
        end: Centre of the other end, metres.
        radius: Metres.
        sides: Sides of the bar around its length.
    """
    a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    length = float(np.linalg.norm(b - a))
    up = (b - a) / length
    side = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    side /= np.linalg.norm(side)
    basis = np.asarray(np.stack([side, np.cross(up, side), up]), dtype=np.float64)
    bar = tube([radius, radius], [0.0, length], sides=sides)
    return Mesh(bar.points @ basis + a, bar.uv, bar.normals @ basis, bar.colours, bar.triangles)


def add_fence(parent: NodePath, thing: Thing, palette: Palette, light: Light) -> None:
    """Attach a fence of posts and two rails.

    Args:
        parent: Node of the scene to which it is attached.
        thing: The object, with its specification, place and seed.
        palette: Textures by name.
        light: Sun and sky of the scene.
    """
    spec = thing.spec
    if not isinstance(spec, Fence):
        raise TypeError(f"{thing.id} is no fence")
    parts = []
    line = [np.array([*point, 0.0]) for point in spec.points]
    for here, there in itertools.pairwise(line):
        count = max(1, round(float(np.linalg.norm(there - here)) / 2.5))
        for k in range(count + 1):
            foot = here + (there - here) * k / count
            parts.append(beam(foot, foot + np.array([0.0, 0.0, spec.height]), 0.06))
        for share in (0.5, 0.88):
            level = np.array([0.0, 0.0, share * spec.height])
            parts.append(beam(here + level, there + level, 0.035))
    attach(parent, spec.id, merged(parts).painted((1.2, 1.15, 1.1)).lit(light.sun), palette["wood"])


@dataclass(frozen=True)
class TowerLook:
    """Construction and paint of a lattice tower."""

    paint: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (0.86, 0.16, 0.12),
        (0.95, 0.95, 0.95),
    )
    """Alternating colours of its bands, from the foot."""
    taper: float = TOWER_TAPER
    """Ratio of the width at the top to that at the foot."""
    section: float = 2.4
    """Approximate distance of two rings of bars, metres."""
    stout: float = 1.0
    """Thickness of the bars relative to the default."""


def add_tower(
    parent: NodePath,
    thing: Thing,
    palette: Palette,
    light: Light,
    look: TowerLook,
) -> None:
    """Attach a lattice tower, with aerials at its top.

    Args:
        parent: Node of the scene to which it is attached.
        thing: The object, with its specification, place and seed.
        palette: Textures by name.
        light: Sun and sky of the scene.
        look: Construction and paint.
    """
    spec = thing.spec
    if not isinstance(spec, Tower):
        raise TypeError(f"{thing.id} is no tower")
    sections = max(4, round(spec.height / look.section))
    levels = np.linspace(0.0, spec.height - 2.0, sections + 1)
    half = spec.width / 2 * np.linspace(1.0, look.taper, sections + 1)
    corner = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    parts = []
    for k in range(sections):
        band = look.paint[k * 7 // sections % 2]
        low = np.c_[corner * half[k], np.full(4, levels[k])]
        high = np.c_[corner * half[k + 1], np.full(4, levels[k + 1])]
        for i in range(4):
            j = (i + 1) % 4
            bars = [(low[i], high[i], 0.07), (low[i], high[j], 0.035), (low[j], high[i], 0.035)]
            bars.append((high[i], high[j], 0.035))
            parts += [beam(a, b, look.stout * radius, 3).painted(band) for a, b, radius in bars]
    top = levels[-1]
    parts.append(beam((0, 0, top), (0, 0, spec.height), 0.05).painted((0.9, 0.9, 0.9)))
    for k in range(3):
        angle = math.tau * k / 3
        out = np.array([math.cos(angle), math.sin(angle), 0.0]) * (half[-1] + 0.35)
        panel = box((0.14, 0.32, 1.6), bottom=True).moved((0, 0, 0), angle)
        parts.append(panel.moved(out + np.array([0.0, 0.0, top - 1.9])).painted((0.88, 0.89, 0.9)))
    dish = tube([0.05, 0.5, 0.62], [0.0, 0.12, 0.3], sides=12)
    swap = [2, 1, 0]
    dish = replace(dish, points=dish.points[:, swap], normals=dish.normals[:, swap])
    parts.append(dish.moved((half[-2], 0, 0.72 * spec.height)).painted((0.93, 0.93, 0.93)))
    tower = merged(parts).moved((thing.x, thing.y, 0.0), thing.yaw)
    node = attach(parent, spec.id, tower.lit(light.sun), palette["plain"], both_sides=True)
    node.set_tag(LABEL, f"{spec.id}/tower")
