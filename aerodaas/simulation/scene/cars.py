"""Scene nodes of cars."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from panda3d.core import NodePath

from aerodaas.simulation.scenario import Car
from aerodaas.simulation.scene.layers import LABEL, attach
from aerodaas.simulation.scene.mesh import Mesh, merged, sheet, tube
from aerodaas.simulation.scene.textures import Palette
from aerodaas.simulation.world import State, Thing, rng_of

__all__ = ["CarFigure", "CarShape"]

_COLOURS = (
    (0.75, 0.10, 0.10),
    (0.12, 0.22, 0.50),
    (0.88, 0.88, 0.88),
    (0.16, 0.17, 0.19),
    (0.60, 0.62, 0.65),
    (0.85, 0.62, 0.10),
    (0.15, 0.38, 0.25),
)
_GLASS, _TYRE, _RIM = (0.13, 0.16, 0.20), (0.08, 0.08, 0.08), (0.62, 0.63, 0.65)

# Side profile, from the rear bumper forward, metres: x, z, half width.
_SILL, _BELT, _ROOF = 0.28, 0.88, 1.43
_BODY = (
    (-2.08, 0.42, 0.80),
    (-2.10, 0.80, 0.84),
    (-1.85, 0.92, 0.86),
    (0.85, 0.92, 0.88),
    (1.85, 0.76, 0.84),
    (2.08, 0.58, 0.78),
    (2.10, 0.42, 0.76),
)
_WHEELS = ((-1.30, 0.0), (1.32, 0.0))
_WHEEL_RADIUS = 0.33
_ABOVE = np.array([0.3, 0.25, 0.92])


@dataclass(frozen=True)
class CarShape:
    """Shape of a car; the default is a saloon of `CAR_SIZE`."""

    cabin: tuple[tuple[float, float], ...] = (
        (-1.75, 0.90),
        (-1.30, 1.40),
        (0.05, 1.43),
        (0.95, 0.90),
    )
    """x and z of the cabin's profile from the rear: sill, roof, roof, sill; metres."""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Scale of the whole car: along, across, up."""


class CarFigure:
    """Scene node of one car."""

    def __init__(self, parent: NodePath, thing: Thing, palette: Palette, shape: CarShape) -> None:
        """Build the car, with its colour by scenario or seed."""
        spec = thing.spec
        if not isinstance(spec, Car):
            raise TypeError(f"{thing.id} is no car")
        rng = rng_of(thing)
        colour = np.array(spec.colour or _COLOURS[rng.integers(len(_COLOURS))])
        self.node = parent.attach_new_node(spec.id)
        mesh = merged([*_body(colour), *_cabin(colour, shape.cabin), *_wheels(), *_lamps()])
        mesh = mesh.moved((0, 0, 0), scale=shape.scale)
        body = attach(self.node, "car", mesh.lit(_ABOVE), palette["plain"], both_sides=True)
        body.set_tag(LABEL, f"{spec.id}/car")

    def pose(self, state: State) -> None:
        """Move the car to `state`."""
        if not state.present:
            self.node.hide()
            return
        self.node.show()
        self.node.set_pos(state.x, state.y, 0.0)
        self.node.set_h(math.degrees(state.yaw))


def _body(colour: NDArray[np.float64]) -> list[Mesh]:
    parts = []
    for (x0, z0, w0), (x1, z1, w1) in itertools.pairwise(_BODY):
        top = sheet([(x1, -w1, z1), (x1, w1, z1), (x0, w0, z0), (x0, -w0, z0)])
        parts.append(_upward(top).painted(colour))
        for side in (-1.0, 1.0):
            wall = sheet(
                [
                    (x0, side * w0, _SILL),
                    (x1, side * w1, _SILL),
                    (x1, side * w1, z1),
                    (x0, side * w0, z0),
                ]
            )
            parts.append(_outward(wall, side).painted(colour))
    return parts


def _cabin(colour: NDArray[np.float64], outline: tuple[tuple[float, float], ...]) -> list[Mesh]:
    low, high = 0.82, 0.66
    half = [low, high, high, low]
    parts = []
    for i, ((x0, z0), (x1, z1)) in enumerate(itertools.pairwise(outline)):
        top = sheet(
            [(x1, -half[i + 1], z1), (x1, half[i + 1], z1), (x0, half[i], z0), (x0, -half[i], z0)]
        )
        roof = i == 1
        parts.append(_upward(top).painted(colour if roof else _GLASS))
    for side in (-1.0, 1.0):
        corners = [(x, side * w, z) for (x, z), w in zip(outline, half, strict=True)]
        pane = sheet([corners[0], corners[3], corners[2], corners[1]])
        parts.append(_outward(pane, side).painted(_GLASS))
        a, b = np.array([-0.35, side * 0.835, 0.9]), np.array([-0.42, side * 0.675, 1.42])
        wide = np.array([0.09, 0, 0])
        parts.append(_outward(sheet([a, a + wide, b + wide, b]), side).painted(colour))
    return parts


def _wheels() -> list[Mesh]:
    parts = []
    for x, _ in _WHEELS:
        for side in (-1.0, 1.0):
            for radius, out, colour in ((_WHEEL_RADIUS, 0.885, _TYRE), (0.20, 0.895, _RIM)):
                drum = tube([radius, radius, 0.001], [0.0, 0.2, 0.2001], sides=12)
                points = drum.points[:, [0, 2, 1]]
                points[:, 1] = side * (points[:, 1] - 0.2 + out)
                normals = np.tile([0.0, side, 0.3], (len(points), 1))
                wheel = Mesh(points, drum.uv, normals, drum.colours, drum.triangles)
                parts.append(wheel.moved((x, 0, _WHEEL_RADIUS)).painted(colour))
    return parts


def _lamps() -> list[Mesh]:
    parts = []
    for side in (-1.0, 1.0):
        for x, z, colour in ((2.105, 0.55, (1.0, 0.98, 0.9)), (-2.115, 0.70, (0.8, 0.08, 0.06))):
            y = side * 0.58
            lamp = sheet(
                [
                    (x, y - 0.16, z),
                    (x, y + 0.16, z),
                    (x, y + 0.16, z + 0.12),
                    (x, y - 0.16, z + 0.12),
                ]
            )
            parts.append(_facing(lamp, (np.sign(x), 0.0, 0.5)).painted(colour))
    plate = sheet(
        [(-2.116, -0.26, 0.5), (-2.116, 0.26, 0.5), (-2.116, 0.26, 0.62), (-2.116, -0.26, 0.62)]
    )
    parts.append(_facing(plate, (-1.0, 0.0, 0.5)).painted((0.95, 0.95, 0.9)))
    return parts


def _facing(mesh: Mesh, normal: tuple[float, float, float]) -> Mesh:
    unit = np.array(normal) / np.linalg.norm(normal)
    return Mesh(mesh.points, mesh.uv, np.tile(unit, (4, 1)), mesh.colours, mesh.triangles)


def _upward(mesh: Mesh) -> Mesh:
    normal = mesh.normals[0] * (1.0 if mesh.normals[0, 2] >= 0 else -1.0)
    return _facing(mesh, (normal[0], normal[1], normal[2]))


def _outward(mesh: Mesh, side: float) -> Mesh:
    normal = mesh.normals[0] * (1.0 if mesh.normals[0, 1] * side >= 0 else -1.0)
    return _facing(mesh, (normal[0], normal[1], normal[2]))
