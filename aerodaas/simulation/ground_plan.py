"""The ground plan of a simulated world: what stands still in it, as a map draws it.

People and cars are left out, those that stand still, too: where they are is for cameras to find.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from aerodaas.simulation.scenario import (
    Building,
    Car,
    CropRows,
    Fence,
    Person,
    Road,
    Rubble,
    Tower,
    Tree,
)
from aerodaas.simulation.world import Thing, World

__all__ = ["Shape", "ShapeKind", "ground_plan"]

ShapeKind: TypeAlias = Literal["building", "crops", "fence", "road", "rubble", "tower", "tree"]
_Point: TypeAlias = tuple[float, float]
_FOOT = [6, 2, 0, 4]
"""Of a box's corners those on the ground, counter-clockwise."""
_KINDS: dict[type, ShapeKind] = {
    Building: "building",
    CropRows: "crops",
    Rubble: "rubble",
    Tower: "tower",
}


@dataclass(frozen=True, slots=True)
class Shape:
    """One thing of the plan."""

    kind: ShapeKind
    outline: tuple[_Point, ...]
    """Metres east and north: the corners of an area, the points of a road's or fence's line, the
    middle of a tree."""
    width: float = 0.0
    """Of a road, and of a tree's crown, metres."""


def ground_plan(world: World) -> list[Shape]:
    """Shapes of a world that stand still, in the scenario's order, to the centimetre."""
    shapes = (shape for thing in world.things if (shape := _shape(thing)) is not None)
    return [
        Shape(
            one.kind,
            tuple((round(east, 2), round(north, 2)) for east, north in one.outline),
            round(one.width, 2),
        )
        for one in shapes
    ]


def _shape(thing: Thing) -> Shape | None:
    spec = thing.spec
    if isinstance(spec, Person | Car):
        return None
    if isinstance(spec, Road):
        return Shape("road", tuple(spec.points), spec.width)
    if isinstance(spec, Fence):
        return Shape("fence", tuple(spec.points))
    (box,) = thing.boxes(0.0)
    if isinstance(spec, Tree):
        return Shape("tree", ((thing.x, thing.y),), box.size[1])
    foot = box.corners[_FOOT, :2].tolist()
    return Shape(_KINDS[type(spec)], tuple((east, north) for east, north in foot))
