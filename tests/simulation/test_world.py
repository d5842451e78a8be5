"""Worlds follow from scenario, seed and time alone, and broken scenarios are told."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic import ValidationError

from aerodaas.config.model import SimulationConfig
from aerodaas.errors import ConfigError
from aerodaas.simulation.scenario import Motion, Scenario, scenario_names
from aerodaas.simulation.skeleton import JOINTS, LIMBS, Posture, joints
from aerodaas.simulation.track import Track
from aerodaas.simulation.world import World

Place = tuple[float, float]
place = st.tuples(st.floats(-50, 50), st.floats(-50, 50))


def make(*entities: dict[str, Any], seed: int = 0) -> World:
    """Make a world of these entities."""
    return World(Scenario.model_validate({"name": "test", "entities": list(entities)}), seed)


@pytest.mark.parametrize("name", scenario_names())
def test_shipped_worlds_load_and_repeat(name: str) -> None:
    """Every shipped world loads; its boxes repeat for a seed at any time."""
    one = World.load(SimulationConfig(world=name, seed=4))
    two = World.load(SimulationConfig(world=name, seed=4))
    for time in (0.0, 12.5, 300.0):
        assert one.boxes(time) == two.boxes(time)


def test_another_seed_places_trees_elsewhere() -> None:
    """Layout follows the seed."""
    boxes = [World.load(SimulationConfig(world="field", seed=seed)).boxes(0.0) for seed in (1, 2)]
    assert boxes[0] != boxes[1]


@pytest.mark.parametrize("seed", range(5))
def test_the_field_keeps_the_survey_free(seed: int) -> None:
    """Over the crops and a margin around them nothing stands in the way at flight height."""
    world = World.load(SimulationConfig(world="field", seed=seed))
    for x in np.linspace(-2, 12, 15):
        for y in np.linspace(-2, 12, 15):
            inside = [box.id for box in world.boxes(0.0) if box.contains((x, y, 1.5), 0.4)]
            assert inside == []


def test_scattered_trees_keep_clear() -> None:
    """Trees stand neither in buildings nor on roads nor where people walk."""
    world = make(
        {"kind": "building", "id": "house", "at": (0, 0), "yaw": 30, "size": (12, 9, 4)},
        {"kind": "road", "id": "road", "points": [(-30, 12), (30, 12)], "width": 4},
        {"kind": "person", "id": "vip", "motion": {"points": [(-30, -12), (30, -12)]}},
        {"kind": "trees", "id": "wood", "count": 40, "area": (-30, -30, 30, 30)},
    )
    trees = [thing for thing in world.things if thing.id.startswith("wood-")]
    house = world.thing("house").boxes(0.0)[0]
    assert len(trees) > 20
    for tree in trees:
        assert not house.contains((tree.x, tree.y, 1.0), 0.5)
        assert abs(tree.y - 12) > 2
        assert abs(tree.y + 12) > 2


@example([(0.0, 1.0), (0.0, 1e-131), (0.0, 0.0)], 1.0, 0.0, "stop", [0.0, 1.0])
@given(
    st.lists(place, min_size=2, max_size=6, unique=True),
    st.floats(0.1, 8),
    st.floats(0, 0.9),
    st.sampled_from(["stop", "loop", "vanish"]),
    st.lists(st.floats(0, 300), min_size=2, max_size=10),
)
def test_things_move_without_jumps(
    points: list[Place],
    speed: float,
    variation: float,
    end: Literal["stop", "loop", "vanish"],
    times: list[float],
) -> None:
    """Between two moments nothing covers more ground than its speed allows."""
    track = Track(Motion(points=points, speed=speed, variation=variation, end=end), "s")
    for time in times:
        here, there = track.at(time), track.at(time + 0.1)
        reach = 0.1 * speed * (1 + variation) + 1e-6
        assert math.dist((here.x, here.y), (there.x, there.y)) <= reach
        assert there.travelled >= here.travelled - 1e-9


def test_a_walk_ends_as_it_says() -> None:
    """It stops at its last point, goes round, or is gone."""
    points = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]
    stop = Track(Motion(points=points, speed=1.0), "s").at(100.0)
    assert (stop.x, stop.y, stop.speed) == (10.0, 10.0, 0.0)
    assert stop.present
    loop = Track(Motion(points=points, end="loop"), "s").at(100.0)
    assert loop.speed > 0.0
    assert not Track(Motion(points=points, end="vanish"), "s").at(100.0).present


@given(st.floats(1.2, 2.1), st.floats(0, 1000), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_bodies_keep_their_bones(
    height: float, travelled: float, stepping: float, raised: float, fallen: float
) -> None:
    """Whatever it does, a body's limbs keep their lengths and it stays above the ground."""
    rest = joints(height, Posture())
    body = joints(height, Posture(travelled, stepping, raised, fallen))
    for upper, lower in LIMBS:
        a, b = JOINTS.index(upper), JOINTS.index(lower)
        length = np.linalg.norm(rest[a] - rest[b])
        assert np.linalg.norm(body[a] - body[b]) == pytest.approx(length, rel=1e-6)
    assert body[:, 2].min() > -0.1


def test_gestures_come_and_go() -> None:
    """A raised hand is above the head while it lasts; the fallen lie where they fell."""
    world = make(
        {
            "kind": "person",
            "id": "vip",
            "motion": {"points": [(0, 0), (30, 0)]},
            "gestures": [
                {"kind": "hand_raised", "start": 5, "duration": 4},
                {"kind": "fallen", "start": 15},
            ],
        }
    )
    vip = world.thing("vip")
    wrist, head = JOINTS.index("right_wrist"), JOINTS.index("head")
    for time, raised in ((2.0, False), (7.0, True), (12.0, False)):
        body = vip.joints(time)
        assert bool(body[wrist, 2] > body[head, 2]) is raised
    assert vip.joints(20.0)[:, 2].max() < 0.5
    assert vip.state(20.0).x == vip.state(60.0).x
    [person] = vip.boxes(20.0)
    assert person.size[0] > 1.4
    assert person.size[2] < 0.7


def test_a_walk_rests_where_it_says() -> None:
    """The pause holds it up at its place for its time; the way before and after is the same."""
    points, pauses = [(0.0, 0.0), (20.0, 0.0)], [{"at": 5.0, "seconds": 10.0}]
    plain = Track(Motion(points=points, variation=0.5), "s")
    resting = Track(Motion.model_validate({**plain._motion.model_dump(), "pauses": pauses}), "s")
    reached = next(time for time in np.arange(0, 20, 0.01) if plain.at(time).travelled >= 5.0)
    for time in (reached + 1.0, reached + 9.0):
        assert resting.at(time).x == pytest.approx(5.0, abs=0.02)
        assert resting.at(time).speed == 0.0
    assert resting.at(reached - 1.0).x == plain.at(reached - 1.0).x
    assert resting.at(reached + 14.0).x == pytest.approx(plain.at(reached + 4.0).x, abs=0.02)


def test_a_seed_displaces_a_walk_but_not_its_start() -> None:
    """Within the jitter; the same seed gives the same way."""
    motion = Motion(points=[(0, 0), (10, 0), (10, 10)], jitter=1.0, variation=0.0)
    one, two, same = (Track(motion, seed) for seed in ("a", "b", "a"))
    assert one.at(0.0).x == two.at(0.0).x == 0.0
    ends = [(track.at(100.0).x, track.at(100.0).y) for track in (one, two, same)]
    assert ends[0] == ends[2] != ends[1]
    assert all(abs(x - 10) <= 1.0 and abs(y - 10) <= 1.0 for x, y in ends)


def test_who_falls_gets_up_and_walks_on() -> None:
    """The fall holds up the walk for as long as it lasts, at a time that the seed shifts."""
    spec = {
        "kind": "person",
        "id": "vip",
        "motion": {"points": [(0, 0), (60, 0)], "speed": 1.0, "variation": 0.0},
        "gestures": [{"kind": "fallen", "start": 10, "duration": 8, "jitter": 3}],
    }
    starts = set()
    for seed in range(5):
        vip = make(spec, seed=seed).thing("vip")
        (fall,) = vip.gestures
        starts.add(fall.start)
        assert abs(fall.start - 10) <= 3
        assert vip.state(fall.start + 4).x == pytest.approx(fall.start)
        assert vip.joints(fall.start + 4)[:, 2].max() < 0.5
        assert vip.joints(fall.start + 10)[:, 2].max() > 1.4
        assert vip.state(40.0).x == pytest.approx(40.0 - 8.7)
    assert len(starts) == 5


def test_boxes_hold_what_they_surround() -> None:
    """A person's joints lie in the person's box, which stands on the ground."""
    world = make({"kind": "person", "id": "vip", "vest": "any", "at": (3, 4), "yaw": 70})
    vip = world.thing("vip")
    person, vest = vip.boxes(0.0)
    assert [person.label, vest.label] == ["person", "vest"]
    assert all(person.contains(tuple(joint), 1e-9) for joint in vip.joints(0.0).tolist())
    assert all(person.contains(tuple(corner), 0.05) for corner in vest.corners.tolist())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", "not JSON"),
        ('{"name": "x", "entities": [{"kind": "dragon", "id": "d"}]}', "entities.0"),
        ('{"name": "x", "entities": [{"kind": "tree", "id": "d", "heigth": 3}]}', "heigth"),
        ('{"name": "x", "entities": [{"kind": "tower", "id": "t", "height": -1}]}', "height"),
        (
            '{"name": "x", "entities": [{"kind": "tree", "id": "t"}, {"kind": "car", "id": "t"}]}',
            "more than one entity is called t",
        ),
        (
            '{"name": "x", "entities": [{"kind": "car", "id": "c", "motion": {"points": []}}]}',
            "points",
        ),
        ('{"name": "x", "entities": [{"kind": "tree", "id": "t", "at": [NaN, 0]}]}', "at.0"),
    ],
)
def test_broken_scenarios_are_told(tmp_path: Path, content: str, words: str) -> None:
    """The error names the file and the place in it."""
    path = tmp_path / "broken.json"
    path.write_text(content)
    with pytest.raises(ConfigError, match=r"broken\.json") as caught:
        World.load(SimulationConfig(world=str(path)))
    assert words in str(caught.value)


def test_a_motion_that_stands_still_is_told() -> None:
    """Two equal points in a row have no direction."""
    with pytest.raises(ValidationError, match="same place"):
        Motion(points=[(0.0, 0.0), (0.0, 0.0)])


def test_a_missing_world_names_the_known_ones() -> None:
    """Neither a name nor a file: the message lists what there is."""
    with pytest.raises(ConfigError, match="campus, disaster, empty, field"):
        World.load(SimulationConfig(world="atlantis"))
