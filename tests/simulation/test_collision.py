"""Distance to what a drone can hit: never too large, nor larger than what the camera sees."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from aerodaas.config.model import SimulationConfig
from aerodaas.simulation.collision import Nearest, Obstacles
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import CAR_SIZE, World

PLACES = st.tuples(st.floats(-12, 12), st.floats(-12, 12), st.floats(0, 12))
TIMES = st.floats(0, 120)
WORLDS = {
    name: Obstacles(World.load(SimulationConfig(world=name, seed=2)))
    for name in ("campus", "disaster", "field", "tower")
}


def only(**entity: Any) -> Obstacles:  # noqa: ANN401
    """Obstacles of a world with one object."""
    entities = [{"id": "it", "at": [0, 0], "yaw": 0, **entity}]
    return Obstacles(World(Scenario.model_validate({"name": "test", "entities": entities})))


def nearest(obstacles: Obstacles, place: tuple[float, float, float], time: float = 0.0) -> Nearest:
    """The nearest object, of which there is one."""
    found = obstacles.nearest(place, time)
    assert found is not None
    return found


@given(st.sampled_from(sorted(WORLDS)), PLACES, PLACES, TIMES)
def test_a_way_changes_the_distance_by_no_more_than_its_length(
    world: str,
    here: tuple[float, float, float],
    there: tuple[float, float, float],
    time: float,
) -> None:
    """It is never negative, and the nearest place is as far as it says."""
    one, other = (nearest(WORLDS[world], place, time) for place in (here, there))
    assert one.distance >= 0.0
    assert abs(one.distance - other.distance) <= math.dist(here, there) + 1e-9
    assert math.dist(here, one.place) == pytest.approx(one.distance)


def grid(*axes: tuple[float, float]) -> NDArray[np.float64]:
    """Points of a box, a tenth of a metre apart or nearer."""
    lines = [np.linspace(low, high, 2 + int((high - low) / 0.1)) for low, high in axes]
    return np.array(list(itertools.product(*lines)))


def barn() -> NDArray[np.float64]:
    """Points of a gable-roofed barn of 4 m x 3 m, whose walls are 2 m high."""
    walls = grid((-2, 2), (-1.5, 1.5), (0, 2))
    roof = grid((-2.45, 2.45), (-1.95, 1.95), (1.5, 2.6))
    ridge, eaves = 2 + 0.35 * 1.5, 2 - 0.35 * 0.45
    under = (roof[:, 2] <= ridge - 0.35 * np.abs(roof[:, 1])) & (roof[:, 2] >= eaves)
    return np.vstack([walls, roof[under]])


def heap() -> NDArray[np.float64]:
    """Points of rubble of 4 m x 3 m x 1 m."""
    points = grid((-2, 2), (-1.5, 1.5), (0, 1))
    return points[((points / (2, 1.5, 1)) ** 2).sum(axis=1) <= 1.0]


SHAPES = {
    "barn": (only(kind="building", size=[4, 3, 2]), barn()),
    "heap": (only(kind="rubble", size=[4, 3, 1]), heap()),
    "car": (only(kind="car"), grid(*((-e / 2, e / 2) for e in CAR_SIZE[:2]), (0, CAR_SIZE[2]))),
}


@given(
    st.sampled_from(sorted(SHAPES)),
    st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(0, 5)),
)
def test_it_agrees_with_points_of_the_shape(shape: str, place: tuple[float, float, float]) -> None:
    """Within the grid's spacing, from all sides and within."""
    obstacles, points = SHAPES[shape]
    away = float(np.linalg.norm(points - place, axis=1).min())
    assert nearest(obstacles, place).distance == pytest.approx(away, abs=0.16)


@given(st.lists(st.tuples(PLACES, st.floats(0, 2)), min_size=2, max_size=12))
def test_a_way_past_everything_is_searched_often_enough(
    steps: list[tuple[tuple[float, float, float], float]],
) -> None:
    """What is asked for along a way is what is found at each place, people on foot included."""
    obstacles, time = WORLDS["campus"], 0.0
    for (here, pause), (there, _) in itertools.pairwise(steps):
        for share in np.linspace(0, 1, 30):
            time += pause / 30
            x, y, z = (float(a + share * (b - a)) for a, b in zip(here, there, strict=True))
            whole = nearest(obstacles, (x, y, z), time)
            found = obstacles.within((x, y, z), time, 0.5)
            assert (found is not None) == (whole.distance < 0.5)
            assert found in {None, whole}


def test_a_tree_is_its_trunk_and_its_crown() -> None:
    """Beside the trunk is room below the crown, which a box around the tree would fill."""
    tree = only(kind="tree", height=8.0)
    assert nearest(tree, (1.2, 0.0, 1.0)).distance == pytest.approx(1.2 - 0.035 * 8, abs=0.01)
    assert nearest(tree, (0.0, 0.0, 5.0)).distance == 0.0
    assert nearest(tree, (1.0, 0.0, 5.0)).distance == 0.0
    assert nearest(tree, (2.6, 2.6, 7.5)).distance > 0.8


def test_a_tower_is_narrow_at_its_top() -> None:
    """A metre beside the middle is within it at the foot, and free above."""
    tower = only(kind="tower", height=36.0, width=3.0)
    assert nearest(tower, (1.3, 0.0, 1.0)).distance == 0.0
    assert nearest(tower, (1.5, 0.0, 25.0)).distance > 0.5
    assert nearest(tower, (0.0, 0.0, 35.9)).distance == 0.0


def test_crops_and_roads_are_no_obstacle() -> None:
    """Nor is an empty world."""
    entities = [
        {"kind": "crop_rows", "id": "crop", "area": [-5, -5, 5, 5]},
        {"kind": "road", "id": "track", "points": [[-5, 0], [5, 0]]},
    ]
    for some in ([], entities):
        world = World(Scenario.model_validate({"name": "test", "entities": some}))
        assert not Obstacles(world)
        assert Obstacles(world).nearest((0.0, 0.0, 0.1), 0.0) is None


def test_a_walker_is_where_the_picture_shows_it() -> None:
    """With its speed, and no longer once it has gone."""
    walk = {"points": [[0, 0], [10, 0]], "speed": 1.0, "variation": 0.0, "end": "vanish"}
    walker = only(kind="person", motion=walk)
    found = nearest(walker, (5.0, 2.0, 1.0), 5.0)
    assert (found.thing, found.label) == ("it", "person")
    assert found.distance == pytest.approx(1.75, abs=0.15)
    assert found.velocity == pytest.approx((1.0, 0.0, 0.0))
    assert walker.nearest((5.0, 2.0, 1.0), 11.0) is None


def test_what_is_ignored_does_not_count() -> None:
    """The next one does."""
    obstacles = WORLDS["field"]
    near = nearest(obstacles, (13.0, 5.0, 1.0))
    assert near.thing == "fence"
    other = obstacles.within((13.0, 5.0, 1.0), 0.0, 100.0, {"fence"})
    assert other is not None
    assert other.thing != "fence"
    assert obstacles.within((13.0, 5.0, 1.0), 0.0, 2.0) == near
