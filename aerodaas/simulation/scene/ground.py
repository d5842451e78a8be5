"""Scene nodes of the ground and of flat objects on it: fields of soil, roads, shadows."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from panda3d.core import NodePath

from aerodaas.simulation.scenario import Building, CropRows, Person, Road, Rubble, Tower, Tree
from aerodaas.simulation.scene.layers import Layer, attach
from aerodaas.simulation.scene.light import HAZE, Light
from aerodaas.simulation.scene.mesh import Mesh, merged, sheet
from aerodaas.simulation.scene.textures import Palette
from aerodaas.simulation.world import CAR_SIZE, CROWN_SHARE, Thing

__all__ = ["add_ground", "add_road", "add_shadow"]

_UP = np.array([0.0, 0.0, 1.0])
_TEXEL = {"grass": 5.0, "soil": 3.0, "asphalt": 3.0, "gravel": 2.0}
"""Size of one repetition of a texture, metres."""

_RADII = np.array([0.0, 4, 8, 13, 20, 30, 45, 65, 95, 140, 200])
"""Radii of the rings of textured ground, metres; beyond, it fades into the haze."""

_FADE = np.array([200.0, 300, 500, 1000])
_SECTORS = 32
_SHADOW_ALPHA = 0.34
_FIELD_MARGIN = 0.5


def add_ground(parent: NodePath, surface: str, palette: Palette, light: Light) -> None:
    """Attach the ground out to the horizon.

    Args:
        parent: Node of the scene to which it is attached.
        surface: Name of its texture.
        palette: Textures by name.
        light: Sun and sky of the scene.
    """
    texture = palette[surface]
    near = _disc(_RADII, _TEXEL[surface]).painted(light_on_ground(light))
    near = near.painted(_patches(near.points)[:, None])
    attach(parent, "ground", near, texture, layer=Layer.GROUND)
    far = _disc(_FADE, 1.0)
    share = np.clip((np.hypot(*far.points[:, :2].T) - _FADE[0]) / 600.0, 0, 1)[:, None] ** 0.6
    average = _average(surface) * light_on_ground(light)
    far = far.painted(average * (1.0 - share) + HAZE * share)
    attach(parent, "distance", far, palette["plain"], layer=Layer.GROUND)


def light_on_ground(light: Light) -> float:
    """Brightness of level ground under `light`."""
    flat = sheet([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]).lit(light.sun)
    return float(flat.colours[0, 0])


def _average(surface: str) -> NDArray[np.float64]:
    table = {
        "grass": (0.44, 0.50, 0.24),
        "soil": (0.43, 0.33, 0.23),
        "asphalt": (0.40, 0.40, 0.41),
    }
    return np.array(table[surface])


def _disc(radii: NDArray[np.float64], texel: float) -> Mesh:
    angles = np.linspace(0, 2 * np.pi, _SECTORS + 1)
    r, angle = np.meshgrid(radii, angles, indexing="ij")
    points = np.stack([r * np.cos(angle), r * np.sin(angle), np.zeros_like(r)], -1).reshape(-1, 3)
    index = np.arange(len(points)).reshape(len(radii), -1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    normals = np.tile(_UP, (len(points), 1))
    return Mesh(points, points[:, :2] / texel, normals, np.ones_like(points), triangles)


def _patches(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slow variation of brightness over the ground, which hides the repetition of its texture."""
    x, y = points[:, 0], points[:, 1]
    waves = np.sin(0.21 * x + 0.13 * y) + np.sin(0.07 * x - 0.17 * y + 1.3)
    return np.asarray(1.0 + 0.04 * (waves + np.sin(0.031 * x + 0.043 * y + 0.5)))


def add_field(parent: NodePath, spec: CropRows, palette: Palette, light: Light) -> None:
    """Attach the soil of a field, with rows slightly darker than the furrows between them.

    Args:
        parent: Node of the scene to which it is attached.
        spec: Area and rows of the field.
        palette: Textures by name.
        light: Sun and sky of the scene.
    """
    west, south, east, north = spec.area
    m = _FIELD_MARGIN
    bed = _level_sheet((west - m, south - m, east + m, north + m), _TEXEL["soil"])
    parts = [bed.painted(light_on_ground(light))]
    for y in np.arange(south + spec.spacing / 2, north, spec.spacing).tolist():
        ridge = _level_sheet((west, y - 0.16, east, y + 0.16), _TEXEL["soil"])
        parts.append(ridge.painted(0.72 * light_on_ground(light)))
    attach(parent, "soil", merged(parts), palette["soil"], layer=Layer.FIELD)


def _level_sheet(area: tuple[float, float, float, float], texel: float) -> Mesh:
    west, south, east, north = area
    corners = np.array([(west, south, 0), (east, south, 0), (east, north, 0), (west, north, 0)])
    return sheet(corners, corners[:, :2] / texel)


def add_road(parent: NodePath, spec: Road, palette: Palette, light: Light) -> None:
    """Attach a road with mitred corners and worn edges.

    Args:
        parent: Node of the scene to which it is attached.
        spec: Points, width and surface of the road.
        palette: Textures by name.
        light: Sun and sky of the scene.
    """
    line = np.array(spec.points)
    steps = np.diff(line, axis=0)
    lengths = np.hypot(*steps.T)
    along = steps / lengths[:, None]
    bends = np.concatenate([along[:1], along[:-1] + along[1:], along[-1:]])
    bends /= np.linalg.norm(bends, axis=1, keepdims=True)
    stretch = np.ones(len(line))
    stretch[1:-1] = 1.0 / np.maximum(0.5, np.sum(bends[1:-1] * along[1:], axis=1))
    across = np.stack([-bends[:, 1], bends[:, 0]], -1) * stretch[:, None]
    travelled = np.concatenate([[0.0], np.cumsum(lengths)])
    texel, bright = _TEXEL[spec.surface], light_on_ground(light)
    strips = [(spec.width * 0.56, 0.80), (spec.width * 0.5, 1.0)]
    if spec.surface == "soil":
        strips += [(spec.width * 0.34, 0.86), (spec.width * 0.2, 1.05)]
    parts = []
    for half, tone in strips:
        left, right = line + half * across, line - half * across
        for i in range(len(steps)):
            corners = np.array([right[i], right[i + 1], left[i + 1], left[i]])
            v = np.array([(0, 0), (lengths[i], 0), (lengths[i], 2 * half), (0, 2 * half)])
            uv = (v + np.array([travelled[i], 0.0])) / texel
            parts.append(sheet(np.c_[corners, np.zeros(4)], uv).painted(tone * bright))
    attach(parent, spec.id, merged(parts), palette[spec.surface], layer=Layer.ROAD)


def add_shadow(parent: NodePath, thing: Thing, palette: Palette, light: Light) -> None:
    """Attach the shadow of an object to `parent`, in its reference frame, level and without yaw.

    The parent of a static object is the world itself; a moving object carries its soft shadow.

    Args:
        parent: Node of the scene to which it is attached.
        thing: The object, with its specification, place and seed.
        palette: Textures by name.
        light: Sun and sky of the scene.
    """
    spec = thing.spec
    if isinstance(spec, Building):
        attach(parent, "shadow", _cast(thing, spec, light), palette["plain"], layer=Layer.SHADOW)
    elif isinstance(spec, Tree):
        radius = CROWN_SHARE * thing.height
        dx, dy = light.shadow_offset(0.62 * thing.height)
        dark = _soft((thing.x + dx, thing.y + dy), 1.25 * radius, 1.25 * radius)
        attach(parent, "shadow", dark, palette["shadow"], layer=Layer.SHADOW)
    elif isinstance(spec, Person):
        attach(parent, "shadow", _soft((0, 0), 0.5, 0.5), palette["shadow"], layer=Layer.SHADOW)
    elif isinstance(spec, Tower | Rubble):
        wide, deep = spec.size[:2] if isinstance(spec, Rubble) else (spec.width, spec.width)
        dark = _soft((thing.x, thing.y), wide, deep)
        attach(parent, "shadow", dark, palette["shadow"], layer=Layer.SHADOW)
    else:
        length, width, _ = CAR_SIZE
        dark = _soft((0, 0), 0.72 * length, 0.85 * width)
        attach(parent, "shadow", dark, palette["shadow"], layer=Layer.SHADOW)


def _soft(centre: tuple[float, float], across: float, deep: float) -> Mesh:
    x, y = centre
    west, east, south, north = x - across, x + across, y - deep, y + deep
    return sheet([(west, south, 0), (east, south, 0), (east, north, 0), (west, north, 0)])


def _cast(thing: Thing, spec: Building, light: Light) -> Mesh:
    """Shadow of a box: the convex hull of its footprint and of the projection of its top."""
    length, width, walls = spec.size
    c, s = math.cos(thing.yaw), math.sin(thing.yaw)
    foot = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (length / 2, width / 2)
    foot = foot @ np.array([[c, s], [-s, c]]) + (thing.x, thing.y)
    top = foot + np.array(light.shadow_offset(1.1 * walls))
    hull = cv2.convexHull(np.concatenate([foot, top]).astype(np.float32)).reshape(-1, 2)
    return _fan(hull, _SHADOW_ALPHA)


def _fan(outline: ArrayLike, alpha: float) -> Mesh:
    """A flat black polygon, of either winding order."""
    flat = np.asarray(outline, dtype=np.float64)
    (ax, ay), (bx, by) = flat[1] - flat[0], flat[2] - flat[0]
    if ax * by < ay * bx:
        flat = flat[::-1]
    points = np.c_[flat, np.zeros(len(flat))]
    rest = np.arange(1, len(points) - 1)
    triangles = np.stack([np.zeros_like(rest), rest, rest + 1], -1)
    normals = np.tile(_UP, (len(points), 1))
    return Mesh(points, 0.0 * points[:, :2], normals, np.zeros_like(points), triangles, alpha)
