"""The ground plan of simulated worlds: what stands still, where it stands, and nobody."""

from __future__ import annotations

import math

import pytest

from aerodaas.config.model import SimulationConfig
from aerodaas.simulation.ground_plan import ground_plan
from aerodaas.simulation.scenario import Scenario, scenario_names
from aerodaas.simulation.world import World

MOVING = {"person", "vest", "car"}


def area_of(outline: tuple[tuple[float, float], ...]) -> float:
    """Square metres, positive for corners that go counter-clockwise."""
    following = outline[1:] + outline[:1]
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(outline, following, strict=True)) / 2


CENTIMETRE = 0.01


@pytest.mark.parametrize("name", scenario_names())
@pytest.mark.parametrize("seed", [0, 7])
def test_each_thing_is_where_its_box_is(name: str, seed: int) -> None:
    """As the drone's collisions have it; people and cars are nobody's to know."""
    world = World.load(SimulationConfig(world=name, seed=seed))
    shapes = [one for one in ground_plan(world) if one.kind not in {"road", "fence"}]
    boxes = [one for one in world.boxes(0.0) if one.label not in {*MOVING, "fence"}]
    assert len(shapes) == len(boxes)
    for shape, box in zip(shapes, boxes, strict=True):
        middle = [sum(axis) / len(shape.outline) for axis in zip(*shape.outline, strict=True)]
        assert middle == pytest.approx(box.centre[:2], abs=CENTIMETRE)
        if shape.kind == "tree":
            assert shape.width == pytest.approx(box.size[0], abs=CENTIMETRE)
        else:
            feet = box.corners[box.corners[:, 2] < 1e-9][:, :2]
            for corner in shape.outline:
                assert min(math.dist(corner, foot) for foot in feet) < CENTIMETRE
            assert area_of(shape.outline) == pytest.approx(box.size[0] * box.size[1], rel=0.05)


def test_roads_and_fences_are_lines_and_nobody_is_shown() -> None:
    """As wide as they are."""
    scenario = Scenario.model_validate(
        {
            "name": "street",
            "entities": [
                {"kind": "road", "id": "way", "points": [[0, 0], [5, 0]], "width": 3},
                {"kind": "fence", "id": "rail", "points": [[0, 2], [5, 2]], "height": 1.5},
                {"kind": "person", "id": "who", "at": [1, 1]},
                {"kind": "car", "id": "parked", "at": [4, -3]},
            ],
        }
    )
    shapes = ground_plan(World(scenario))
    assert [(one.kind, one.outline, one.width) for one in shapes] == [
        ("road", ((0, 0), (5, 0)), 3.0),
        ("fence", ((0, 2), (5, 2)), 0.0),
    ]
