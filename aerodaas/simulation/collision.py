"""Solid bodies of a simulated world, and the distance from a place to the nearest of them.

A body has the outline that the camera sees: a gable roof with its eaves, the clumps of leaves of a
tree's crown, the taper of a lattice tower. Young crops and roads are no obstacle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from aerodaas.simulation.scenario import Building, Car, CropRows, Person, Road, Rubble, Tower, Tree
from aerodaas.simulation.world import (
    EAVES,
    LEAF_FLATNESS,
    ROOF_RISE,
    TOWER_TAPER,
    TRUNK_SHARE,
    Box,
    Thing,
    World,
    crown_clumps,
    rng_of,
)

__all__ = ["BODY", "CLEARANCE", "Nearest", "Obstacles"]

Triple: TypeAlias = tuple[float, float, float]
_Shape: TypeAlias = Callable[[float, float, float], Triple]
"""Place of a body that is nearest to one given along its yaw, across it and up of its foot."""

BODY = 0.2
"""Metres around the drone's centre that must stay free: its body with the rotors."""
CLEARANCE = 0.5
"""Metres around the drone's centre that a good way keeps free: its body, and 0.3 m by which a
position is wrong or a gust carries it off."""
_TALL, _WIDE = 3.2, 2.6
"""Metres up and around a person's or car's place within which all of it is."""
_SLICES = 12
"""Blocks of which a tapering tower is made."""
_AERIALS = (1.9, 0.45)
"""Metres below a tower's top section, and beyond it, to which the aerials reach."""
_MAST, _ROD = 2.0, 0.05
"""Length and radius of the rod on a tower, metres."""
_FLAT = (0.15, 0.3, 0.05)
"""Metres by which the slab of a flat roof is wider, lower and higher than the walls."""
_NEWTON_STEPS = 40


@dataclass(frozen=True, slots=True)
class Nearest:
    """The object that is nearest to a place."""

    thing: str
    """Id of the object."""
    label: str
    """Its kind, such as `building`, `tree` or `person`."""
    distance: float
    """Metres to its surface; 0 within it."""
    place: Triple
    """The place of the object that is nearest, ENU metres."""
    velocity: Triple = (0.0, 0.0, 0.0)
    """Of the object, ENU m/s."""


@dataclass(frozen=True, slots=True)
class _Body:
    """One convex part of an object, within an upright cylinder."""

    thing: str
    label: str
    x: float
    y: float
    cosine: float
    sine: float
    reach: float
    """Radius of the cylinder, metres."""
    bottom: float
    top: float
    shape: _Shape

    def nearest(self, point: Triple) -> tuple[float, Triple]:
        """Distance from a point, and the nearest place of the body, ENU metres."""
        dx, dy = point[0] - self.x, point[1] - self.y
        c, s = self.cosine, self.sine
        own = c * dx + s * dy, c * dy - s * dx, point[2]
        along, across, up = found = self.shape(*own)
        place = self.x + c * along - s * across, self.y + s * along + c * across, up
        # Of own places, so that it is 0 within, whatever turning rounds.
        return math.dist(own, found), place


class Obstacles:
    """All solid objects of a world at any time."""

    def __init__(self, world: World) -> None:
        """Find the bodies of all that stands still."""
        self._bodies: list[_Body] = []
        self._moving: list[Thing] = []
        for thing in world.things:
            if isinstance(thing.spec, Person | Car) and thing.moves:
                self._moving.append(thing)
            else:
                self._bodies += _bodies(thing, 0.0)
        self.fastest = max(map(_pace, self._moving), default=0.0)
        """Greatest speed of a person or car along its way, m/s."""
        table = np.array(
            [(one.x, one.y, one.reach, one.bottom, one.top) for one in self._bodies]
        ).reshape(-1, 5)
        self._x, self._y, self._reach, self._bottom, self._top = table.T.copy()
        self._latest: tuple[Triple, float, float, Collection[str]] = (0.0, 0.0, 0.0), 0.0, 0.0, ()
        """Place, time, free distance and ignored things of the latest search."""

    def __bool__(self) -> bool:
        """Whether there is anything."""
        return bool(self._bodies or self._moving)

    def nearest(self, point: Triple, time: float, ignored: Collection[str] = ()) -> Nearest | None:
        """The nearest object; None in a world without any.

        Args:
            point: Place, ENU metres.
            time: Mission time, seconds.
            ignored: Ids of objects that do not count.
        """
        return self._search(point, time, ignored)[0]

    def within(
        self, point: Triple, time: float, reach: float, ignored: Collection[str] = ()
    ) -> Nearest | None:
        """The nearest object if it is nearer than `reach`; None otherwise.

        It is quick for points along a way: it searches only where something can have come so near
        since the latest search.

        Args:
            point: Place, ENU metres.
            time: Mission time, seconds.
            reach: Metres.
            ignored: Ids of objects that do not count.
        """
        place, moment, free, without = self._latest
        moved = math.dist(point, place) + self.fastest * abs(time - moment)
        if free - moved >= reach and without == ignored:
            return None
        found, free = self._search(point, time, ignored)
        self._latest = point, time, free, ignored
        return found if found is not None and found.distance < reach else None

    def _search(
        self, point: Triple, time: float, ignored: Collection[str]
    ) -> tuple[Nearest | None, float]:
        """The nearest object, and the free distance.

        No body that stands still is nearer, nor the room of any that moves.
        """
        best: Nearest | None = None
        closest = math.inf
        for bound, body in self._standing(point):
            if bound >= closest:
                break
            if body.thing not in ignored:
                distance, place = body.nearest(point)
                if distance < closest:
                    closest = distance
                    best = Nearest(body.thing, body.label, distance, place)
        free = closest
        for thing in self._moving:
            state = thing.state(time)
            if thing.id in ignored or not state.present:
                continue
            across = math.hypot(point[0] - state.x, point[1] - state.y) - _WIDE
            bound = math.hypot(max(across, 0.0), max(point[2] - _TALL, 0.0))
            free = min(free, bound)
            if bound >= closest:
                continue
            for body in _bodies(thing, time):
                distance, place = body.nearest(point)
                if distance < closest:
                    closest = distance
                    pace = state.speed * math.cos(state.yaw), state.speed * math.sin(state.yaw)
                    best = Nearest(body.thing, body.label, distance, place, (*pace, 0.0))
        return best, free

    def _standing(self, point: Triple) -> Iterator[tuple[float, _Body]]:
        """Bodies that stand still, with a lower bound of their distance, nearest bound first."""
        across = np.hypot(point[0] - self._x, point[1] - self._y) - self._reach
        aside = np.maximum(self._bottom - point[2], point[2] - self._top)
        bounds = np.hypot(np.maximum(across, 0.0), np.maximum(aside, 0.0))
        for index in np.argsort(bounds).tolist():
            yield float(bounds[index]), self._bodies[index]


def _pace(thing: Thing) -> float:
    """Greatest speed of a person or car along its way, m/s."""
    motion = thing.spec.motion if isinstance(thing.spec, Person | Car) else None
    return 0.0 if motion is None else motion.speed * (1.0 + motion.variation)


def _bodies(thing: Thing, time: float) -> list[_Body]:
    """Convex parts of an object at `time`; empty for what is no obstacle."""
    spec = thing.spec
    if isinstance(spec, CropRows | Road):
        return []
    if isinstance(spec, Building):
        return _building(thing, spec)
    if isinstance(spec, Tree):
        return _tree(thing)
    if isinstance(spec, Tower):
        return _tower(thing, spec)
    if isinstance(spec, Rubble):
        radii = spec.size[0] / 2, spec.size[1] / 2, spec.size[2]
        reach = max(radii[:2])
        return [_body(thing, reach, 0.0, radii[2], _ellipsoid(0.0, radii))]
    boxes = thing.boxes(time)
    # A vest is part of its person.
    return [_boxed(box) for box in (boxes[:1] if isinstance(spec, Person) else boxes)]


def _building(thing: Thing, spec: Building) -> list[_Body]:
    length, width, walls = spec.size
    if spec.roof == "flat":
        wider, lower, higher = _FLAT
        slab = length / 2 + wider, width / 2 + wider
        roof = _block_body(thing, *slab, max(0.0, walls - lower), walls + higher)
    else:
        half, out = length / 2 + EAVES, width / 2 + EAVES
        eaves, ridge = max(0.0, walls - ROOF_RISE * EAVES), walls + ROOF_RISE * width / 2
        roof = _body(thing, math.hypot(half, out), eaves, ridge, _roof(half, out, eaves, ridge))
    return [_block_body(thing, length / 2, width / 2, 0.0, walls), roof]


def _tree(thing: Thing) -> list[_Body]:
    girth, middle = TRUNK_SHARE * thing.height, 0.0
    bodies = []
    for (east, north, up), radius in crown_clumps(thing, rng_of(thing)):
        shape = _ellipsoid(up, (radius, radius, LEAF_FLATNESS * radius))
        place = thing.x + east, thing.y + north
        extent = up - LEAF_FLATNESS * radius, up + LEAF_FLATNESS * radius
        bodies.append(_Body(thing.id, "tree", *place, 1.0, 0.0, radius, *extent, shape))
        middle = max(middle, up)
    return [_block_body(thing, girth, girth, 0.0, middle), *bodies]


def _tower(thing: Thing, spec: Tower) -> list[_Body]:
    foot, top = spec.width / 2, max(spec.height - _MAST, 0.0)
    cuts = np.linspace(0.0, top, _SLICES + 1)
    halves = foot * np.linspace(1.0, TOWER_TAPER, _SLICES + 1)
    bodies = [
        _block_body(thing, half, half, low, high)
        for half, low, high in zip(halves.tolist(), cuts.tolist(), cuts[1:].tolist(), strict=False)
    ]
    below, beyond = _AERIALS
    aerials = foot * TOWER_TAPER + beyond
    return [
        *bodies,
        _block_body(thing, aerials, aerials, max(0.0, top - below), top),
        _block_body(thing, _ROD, _ROD, top, spec.height),
    ]


def _body(thing: Thing, reach: float, bottom: float, top: float, shape: _Shape) -> _Body:
    turn = math.cos(thing.yaw), math.sin(thing.yaw)
    return _Body(thing.id, thing.spec.kind, thing.x, thing.y, *turn, reach, bottom, top, shape)


def _block_body(
    thing: Thing, half_length: float, half_width: float, bottom: float, top: float
) -> _Body:
    shape = _block(half_length, half_width, bottom, top)
    return _body(thing, math.hypot(half_length, half_width), bottom, top, shape)


def _boxed(box: Box) -> _Body:
    (x, y, middle), (length, width, height) = box.centre, box.size
    bottom, top = middle - height / 2, middle + height / 2
    return _Body(
        *(box.id, box.label, x, y, math.cos(box.yaw), math.sin(box.yaw)),
        *(math.hypot(length, width) / 2, bottom, top),
        _block(length / 2, width / 2, bottom, top),
    )


def _block(half_length: float, half_width: float, bottom: float, top: float) -> _Shape:
    def nearest(along: float, across: float, up: float) -> Triple:
        return (
            min(max(along, -half_length), half_length),
            min(max(across, -half_width), half_width),
            min(max(up, bottom), top),
        )

    return nearest


def _roof(half: float, out: float, eaves: float, ridge: float) -> _Shape:
    """Nearest place of a gable roof, a prism with its ridge along the yaw.

    Args:
        half: Half of its length, metres.
        out: Half of its width, metres.
        eaves: Height of its lower edges, metres.
        ridge: Height of its ridge, metres.
    """
    rise = ridge - eaves
    square = out * out + rise * rise

    def nearest(along: float, across: float, up: float) -> Triple:
        side = abs(across)
        along = min(max(along, -half), half)
        if up <= eaves:
            return along, min(max(across, -out), out), eaves
        if side * rise <= (ridge - up) * out:
            return along, across, up
        share = min(max(((out - side) * out + (up - eaves) * rise) / square, 0.0), 1.0)
        return along, math.copysign((1.0 - share) * out, across), eaves + share * rise

    return nearest


def _ellipsoid(middle: float, radii: Triple) -> _Shape:
    """Nearest place of an ellipsoid around the foot's axis, by Newton's method.

    The distance to the surface grows with one root of a convex and falling function (Eberly,
    "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid", 2013).

    Args:
        middle: Height of its centre, metres.
        radii: Along, across and up, metres.
    """
    squares = tuple(radius * radius for radius in radii)

    def nearest(along: float, across: float, up: float) -> Triple:
        point = along, across, up - middle
        if sum(x * x / square for x, square in zip(point, squares, strict=True)) <= 1.0:
            return along, across, up
        root = 0.0
        for _ in range(_NEWTON_STEPS):
            value, slope = -1.0, 0.0
            for x, square in zip(point, squares, strict=True):
                term = square * x * x / (root + square) ** 2
                value += term
                slope -= 2.0 * term / (root + square)
            step = value / slope
            root -= step
            if -step <= 1e-12 * root:
                break
        x, y, z = (x * square / (root + square) for x, square in zip(point, squares, strict=True))
        return x, y, z + middle

    return nearest
