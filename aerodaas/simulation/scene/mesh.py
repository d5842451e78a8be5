"""Triangle meshes as numpy arrays with baked lighting, and their panda3d nodes.

Light is baked into the vertices' colours, so that the software renderer only interpolates, which
halves the time per frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from panda3d.core import (
    Geom,
    GeomNode,
    GeomTriangles,
    GeomVertexData,
    GeomVertexFormat,
)

__all__ = [
    "Mesh",
    "blob",
    "box",
    "merged",
    "sheet",
    "tube",
]

Floats = NDArray[np.float64]

_VERTEX = np.dtype([("point", "<f4", 3), ("colour", "u1", 4), ("uv", "<f4", 2)])
"""panda3d's vertex format v3c4t2."""

_AMBIENT, _DIFFUSE, _SKYLIGHT = 0.52, 0.55, 0.08


@dataclass(frozen=True)
class Mesh:
    """Vertices with texture coordinates, normals and colours, and triangles between them."""

    points: Floats
    """Vertices (n, 3), metres."""
    uv: Floats
    """Texture coordinates (n, 2)."""
    normals: Floats
    """Normals (n, 3) of unit length."""
    colours: Floats
    """Colours (n, 3), red, green and blue, 0 to 1; they tint the texture."""
    triangles: NDArray[np.int64]
    """Indices (m, 3), counter-clockwise seen from outside."""
    alpha: float = 1.0

    def painted(self, colour: ArrayLike) -> Mesh:
        """Copy tinted with one colour or one per vertex."""
        return replace(self, colours=self.colours * np.asarray(colour, dtype=np.float64))

    def moved(self, offset: ArrayLike, yaw: float = 0.0, scale: ArrayLike = 1.0) -> Mesh:
        """Copy scaled, then rotated about z, then translated.

        Args:
            offset: Metres, (3,).
            yaw: Radians.
            scale: Factor, or one for each axis, (3,).
        """
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        factor = np.broadcast_to(np.asarray(scale, dtype=np.float64), (3,))
        normals = self.normals / factor
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        points = (self.points * factor) @ turn + np.asarray(offset, dtype=np.float64)
        return replace(self, points=points, normals=normals @ turn)

    def lit(self, sun: ArrayLike) -> Mesh:
        """Copy with baked light from a sun in this direction (unit vector)."""
        facing = np.clip(self.normals @ np.asarray(sun, dtype=np.float64), 0.0, 1.0)
        light = _AMBIENT + _DIFFUSE * facing + _SKYLIGHT * self.normals[:, 2]
        return self.painted(light[:, None])

    def node(self, name: str) -> GeomNode:
        """Make the panda3d node."""
        vertices = np.zeros(len(self.points), dtype=_VERTEX)
        vertices["point"] = self.points
        vertices["colour"][:, :3] = np.clip(self.colours * 255.0, 0, 255)
        vertices["colour"][:, 3] = round(self.alpha * 255)
        vertices["uv"] = self.uv
        data = GeomVertexData(name, GeomVertexFormat.get_v3c4t2(), Geom.UH_static)
        data.unclean_set_num_rows(len(vertices))
        data.modify_array_handle(0).copy_data_from(vertices.tobytes())
        primitive = GeomTriangles(Geom.UH_static)
        primitive.set_index_type(Geom.NT_uint32)
        indices = primitive.modify_vertices()
        indices.unclean_set_num_rows(self.triangles.size)
        indices.modify_handle().copy_data_from(self.triangles.astype("<u4").tobytes())
        geom = Geom(data)
        geom.add_primitive(primitive)
        node = GeomNode(name)
        node.add_geom(geom)
        return node


def merged(meshes: Iterable[Mesh]) -> Mesh:
    """Merge meshes into one, with the alpha of the first."""
    parts = list(meshes)
    starts = np.cumsum([0] + [len(part.points) for part in parts[:-1]])
    return Mesh(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.uv for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.colours for part in parts]),
        np.concatenate([part.triangles + at for part, at in zip(parts, starts, strict=True)]),
        parts[0].alpha,
    )


def sheet(corners: ArrayLike, uv: ArrayLike = ((0, 0), (1, 0), (1, 1), (0, 1))) -> Mesh:
    """A flat quadrangle.

    Args:
        corners: Four corners, counter-clockwise seen from its front, metres, (4, 3).
        uv: Texture coordinates of the corners, (4, 2).
    """
    points = np.asarray(corners, dtype=np.float64)
    normal = np.cross(points[1] - points[0], points[3] - points[0])
    normal = normal / np.linalg.norm(normal)
    return Mesh(
        points,
        np.asarray(uv, dtype=np.float64),
        np.tile(normal, (4, 1)),
        np.ones((4, 3)),
        np.array([[0, 1, 2], [0, 2, 3]]),
    )


def box(size: ArrayLike, *, texel: float = 1.0, bottom: bool = False) -> Mesh:
    """A box standing centred on the origin.

    Args:
        size: Length, width and height, metres.
        texel: Distance after which its texture repeats, metres.
        bottom: Whether it has a face below.
    """
    x, y, z = (float(extent) for extent in np.asarray(size, dtype=np.float64))
    hx, hy = x / 2, y / 2
    sides = [
        ((-hx, -hy), (hx, -hy), x),
        ((hx, -hy), (hx, hy), y),
        ((hx, hy), (-hx, hy), x),
        ((-hx, hy), (-hx, -hy), y),
    ]
    faces = [
        sheet(
            [(*a, 0), (*b, 0), (*b, z), (*a, z)],
            np.array([(0, 0), (width, 0), (width, z), (0, z)]) / texel,
        )
        for a, b, width in sides
    ]
    lid = np.array([(0, 0), (x, 0), (x, y), (0, y)]) / texel
    faces.append(sheet([(-hx, -hy, z), (hx, -hy, z), (hx, hy, z), (-hx, hy, z)], lid))
    if bottom:
        faces.append(sheet([(-hx, hy, 0), (hx, hy, 0), (hx, -hy, 0), (-hx, -hy, 0)], lid))
    return merged(faces)


def tube(radii: ArrayLike, heights: ArrayLike, *, sides: int = 8, flatten: float = 1.0) -> Mesh:
    """A solid of revolution about z.

    Texture coordinate u runs once around from the back, v from the bottom to the top.

    Args:
        radii: Radii, metres, (N,).
        heights: Heights of the radii, metres, (N,).
        sides: Sides around its axis.
        flatten: Scale along x.
    """
    ring = np.asarray(radii, dtype=np.float64)
    level = np.asarray(heights, dtype=np.float64)
    angles = np.linspace(-np.pi, np.pi, sides + 1)
    around = np.stack([flatten * np.cos(angles), np.sin(angles), np.zeros(sides + 1)], axis=1)
    points = (ring[:, None, None] * around[None]) + np.array([0, 0, 1]) * level[:, None, None]
    normals = np.stack([np.cos(angles) / flatten, np.sin(angles), np.zeros(sides + 1)], axis=1)
    slope = -np.gradient(ring, level)
    normals = np.tile(normals, (len(ring), 1, 1))
    normals[..., 2] = slope[:, None]
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    span = level[-1] - level[0]
    u, v = np.meshgrid(np.linspace(0, 1, sides + 1), (level - level[0]) / span)
    return Mesh(
        points.reshape(-1, 3),
        np.stack([u, v], axis=-1).reshape(-1, 2),
        normals.reshape(-1, 3),
        np.ones((points.size // 3, 3)),
        _grid_triangles(len(ring), sides + 1),
    )


def blob(radius: float, *, rings: int = 6, sides: int = 8, repeat: float = 2.0) -> Mesh:
    """A sphere around the origin.

    Args:
        radius: Metres.
        rings: Circles of latitude, poles included.
        sides: Sides around its axis.
        repeat: How often its texture repeats around.
    """
    polar = np.linspace(-np.pi / 2, np.pi / 2, rings)
    angles = np.linspace(-np.pi, np.pi, sides + 1)
    latitude, longitude = np.meshgrid(polar, angles, indexing="ij")
    normals = np.stack(
        [
            np.cos(latitude) * np.cos(longitude),
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude),
        ],
        axis=-1,
    ).reshape(-1, 3)
    uv = np.stack([longitude / (2 * np.pi) * repeat, latitude / np.pi * repeat / 2], axis=-1)
    return Mesh(
        radius * normals,
        uv.reshape(-1, 2),
        normals,
        np.ones_like(normals),
        _grid_triangles(rings, sides + 1),
    )


def _grid_triangles(rows: int, columns: int) -> NDArray[np.int64]:
    """Triangles of a grid of vertices, columns running counter-clockwise, rows upwards."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b = index[:-1, :-1], index[:-1, 1:]
    c, d = index[1:, 1:], index[1:, :-1]
    return np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
