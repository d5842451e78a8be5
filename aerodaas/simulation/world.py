"""Simulated world: the objects of a scenario, placed by a seed, at any time.

There is no world server: the state of an object is a pure function of scenario, seed and time, so
that every process computes the same world.
"""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aerodaas.config.model import SimulationConfig
from aerodaas.simulation.scenario import (
    Building,
    Car,
    CropRows,
    Fence,
    Gesture,
    Motion,
    Person,
    Road,
    Rubble,
    Scenario,
    Tower,
    Tree,
    Trees,
    load_scenario,
)
from aerodaas.simulation.skeleton import KEYPOINTS, Posture, joints
from aerodaas.simulation.track import Track

__all__ = [
    "CAR_SIZE",
    "EAVES",
    "ROOF_RISE",
    "Box",
    "State",
    "Thing",
    "World",
    "crown_clumps",
    "rng_of",
]

_SIGNS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


@dataclass(frozen=True, slots=True)
class Box:
    """An upright box: centre in ENU metres, extents along its own axes, yaw in radians."""

    id: str
    """Id of the enclosed entity."""
    label: str
    """`person`, `vest`, `car`, `tower`, `tree`, `building`, `crop_rows`, `rubble` or
    `fence`."""
    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    """Extents along its yaw, across it and up, metres."""
    yaw: float = 0.0

    @property
    def corners(self) -> NDArray[np.float64]:
        """Corners as (8, 3) ENU metres."""
        local = _SIGNS * np.array(self.size)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(local @ turn + np.array(self.centre))

    def contains(self, point: tuple[float, float, float], margin: float = 0.0) -> bool:
        """Whether a point lies within the widened box.

        Args:
            point: ENU metres.
            margin: By how much the box is wider on each side, metres.
        """
        x, y, z = (here - there for here, there in zip(point, self.centre, strict=True))
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        own = (c * x + s * y, c * y - s * x, z)
        return all(
            abs(part) <= 0.5 * extent + margin for part, extent in zip(own, self.size, strict=True)
        )


CAR_SIZE = (4.2, 1.8, 1.45)
"""Length, width and height of a car, metres."""

ROOF_RISE = 0.35
"""Ratio of a gable roof's rise to half the width of its building."""

EAVES = 0.45
"""Overhang of a gable roof over the walls, metres."""

CROWN_SHARE = 0.36
"""Ratio of a tree's crown radius to its height."""

TRUNK_SHARE = 0.035
"""Ratio of a trunk's radius to the tree's height."""

LEAF_FLATNESS = 0.88
"""Ratio of the height of a clump of leaves to its width."""

TOWER_TAPER = 0.22
"""Ratio of a tower's width at the top to that at the foot."""

_BRISK = 1.3
"""Walking speed in m/s at which the legs swing fully."""

_GESTURE_TIME = 0.7
"""Duration of a person's change of posture, seconds."""

_TREE_GAP = 2.5
"""Least distance of a scattered tree's trunk from any other object, metres."""

_BODY_MARGIN = (0.10, 0.06, 0.13)
"""Extent of the body beyond a person's joints in metres: ahead, sideways, up."""

_VEST_MARGIN = (0.135, 0.02, 0.02)
"""The same for the chest beyond pelvis, neck and shoulders."""


@dataclass(frozen=True, slots=True)
class State:
    """Position and posture of an object at one time."""

    x: float
    y: float
    yaw: float
    """Radians counter-clockwise from east."""
    present: bool = True
    posture: Posture = field(default_factory=Posture)
    speed: float = 0.0


@dataclass(frozen=True)
class Thing:
    """One object of a world: its specification, its position and its random values."""

    spec: Tree | Building | CropRows | Road | Rubble | Fence | Person | Car | Tower
    seed: str
    """Seed of the object's appearance, the same in every process."""
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    height: float = 0.0
    """Height in metres, for kinds with a height."""
    track: Track | None = None
    gestures: tuple[Gesture, ...] = ()
    """Gestures of a person, with their randomly shifted times."""

    @property
    def id(self) -> str:
        """Id in the scenario."""
        return self.spec.id

    @property
    def moves(self) -> bool:
        """Whether its state depends on time."""
        return self.track is not None or bool(self.gestures)

    def state(self, time: float) -> State:
        """State at `time` seconds of mission time."""
        if self.track is None:
            return State(self.x, self.y, self.yaw, posture=self._posture(time, 0.0, 0.0))
        lying, lies = self._lying(time)
        point = self.track.at(time - lying)
        speed = 0.0 if lies else point.speed
        posture = self._posture(time, point.travelled, speed)
        return State(point.x, point.y, point.yaw, point.present, posture, speed)

    def _lying(self, time: float) -> tuple[float, bool]:
        """Seconds until `time` for which falls stopped the walk, and whether one does so then."""
        lying, lies = 0.0, False
        for gesture in self.gestures:
            if gesture.kind == "fallen" and time > gesture.start:
                down = gesture.duration + _GESTURE_TIME
                lying += min(time - gesture.start, down)
                lies = lies or time < gesture.start + down
        return lying, lies

    def _posture(self, time: float, travelled: float, speed: float) -> Posture:
        if not isinstance(self.spec, Person):
            return Posture()
        done = {"hand_raised": 0.0, "fallen": 0.0}
        for gesture in self.gestures:
            rise = _smooth((time - gesture.start) / _GESTURE_TIME)
            fall = _smooth((time - gesture.start - gesture.duration) / _GESTURE_TIME)
            done[gesture.kind] = max(done[gesture.kind], rise - fall)
        stepping = min(1.0, speed / _BRISK) ** 0.5
        forward = any(one.forward for one in self.gestures if one.kind == "fallen")
        return Posture(travelled, stepping, done["hand_raised"], done["fallen"], forward)

    def joints(self, time: float) -> NDArray[np.float64]:
        """Joints of a person at `time`, rows as in `skeleton.JOINTS`, ENU metres."""
        state = self.state(time)
        body = joints(self.height, state.posture)
        c, s = math.cos(state.yaw), math.sin(state.yaw)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(body @ turn + np.array([state.x, state.y, 0.0]))

    def keypoints(self, time: float) -> NDArray[np.float64]:
        """A person's 17 COCO keypoints at `time`, (17, 3) ENU metres."""
        return self.joints(time)[list(KEYPOINTS)]

    def boxes(self, time: float) -> list[Box]:
        """Boxes around the object at `time`; empty if it has disappeared or is flat."""
        state, spec = self.state(time), self.spec
        if not state.present or isinstance(spec, Road):
            return []
        if isinstance(spec, Person):
            return self._person_boxes(state)
        size = self._size()
        if isinstance(spec, CropRows):
            west, south, east, north = spec.area
            centre = ((west + east) / 2, (south + north) / 2, size[2] / 2)
            return [Box(self.id, spec.kind, centre, size)]
        if isinstance(spec, Fence):
            return _fence_boxes(spec)
        return [Box(self.id, spec.kind, (state.x, state.y, size[2] / 2), size, state.yaw)]

    def _size(self) -> tuple[float, float, float]:
        spec = self.spec
        if isinstance(spec, Building):
            length, width, walls = spec.size
            rise = ROOF_RISE * width / 2 if spec.roof == "gable" else 0.0
            return length, width, walls + rise
        if isinstance(spec, CropRows):
            west, south, east, north = spec.area
            return east - west, north - south, spec.height
        if isinstance(spec, Car):
            return CAR_SIZE
        if isinstance(spec, Rubble):
            return spec.size
        if isinstance(spec, Tower):
            return spec.width, spec.width, spec.height
        return 2 * CROWN_SHARE * self.height, 2 * CROWN_SHARE * self.height, self.height

    def _person_boxes(self, state: State) -> list[Box]:
        body = joints(self.height, state.posture)
        result = [self._box_around("person", body, state, _BODY_MARGIN)]
        if isinstance(self.spec, Person) and self.spec.vest != "none":
            result.append(self._box_around("vest", body[[0, 1, 3, 4]], state, _VEST_MARGIN))
        return result

    def _box_around(
        self,
        label: str,
        points: NDArray[np.float64],
        state: State,
        margin: tuple[float, float, float],
    ) -> Box:
        low, high = points.min(axis=0) - np.array(margin), points.max(axis=0) + np.array(margin)
        low[2] = max(0.0, low[2])
        middle, size = (low + high) / 2, high - low
        c, s = math.cos(state.yaw), math.sin(state.yaw)
        x = state.x + c * middle[0] - s * middle[1]
        y = state.y + s * middle[0] + c * middle[1]
        extent = (float(size[0]), float(size[1]), float(size[2]))
        return Box(self.id, label, (float(x), float(y), float(middle[2])), extent, state.yaw)


class World:
    """All objects of a scenario under one seed."""

    def __init__(self, scenario: Scenario, seed: int = 0) -> None:
        """Place all objects."""
        self.scenario = scenario
        self.seed = seed
        things = [
            _place(spec, f"{seed}/{spec.id}")
            for spec in scenario.entities
            if not isinstance(spec, Trees)
        ]
        obstacles = [box for thing in things for box in thing.boxes(0.0)]
        roads = [spec for spec in scenario.entities if isinstance(spec, Road)]
        walks = [
            spec.motion
            for spec in scenario.entities
            if isinstance(spec, Person | Car) and spec.motion is not None
        ]
        for spec in scenario.entities:
            if isinstance(spec, Trees):
                things.extend(_scatter(spec, f"{seed}/{spec.id}", obstacles, roads, walks))
        self.things = tuple(things)

    @classmethod
    def load(cls, config: SimulationConfig) -> World:
        """Create the world of an environment; raises ConfigError for an invalid scenario."""
        return cls(load_scenario(config.world), config.seed)

    def thing(self, name: str) -> Thing:
        """Return the object with the id `name`; raises KeyError if there is none."""
        for thing in self.things:
            if thing.id == name:
                return thing
        raise KeyError(name)

    def boxes(self, time: float) -> list[Box]:
        """Boxes around all objects at `time` seconds."""
        return [box for thing in self.things for box in thing.boxes(time)]


def rng_of(thing: Thing) -> np.random.Generator:
    """Random generator of an object's appearance, the same in every process."""
    return np.random.default_rng(list(thing.seed.encode()))


def crown_clumps(
    thing: Thing, rng: np.random.Generator
) -> list[tuple[tuple[float, float, float], float]]:
    """Clumps of leaves of a tree's crown: each one's centre from the tree's foot, and its radius.

    Args:
        thing: The tree.
        rng: Generator of its appearance, as it is at first.
    """
    radius, middle = CROWN_SHARE * thing.height, 0.62 * thing.height
    clumps = [((0.0, 0.0, middle), 0.76), ((0.0, 0.0, middle + 0.42 * radius), 0.52)]
    for k in range(5):
        angle = math.tau * k / 5 + rng.uniform(-0.3, 0.3) + thing.yaw
        out, up = 0.5 * radius, rng.uniform(-0.25, 0.12) * radius
        centre = (out * math.cos(angle), out * math.sin(angle), middle + up)
        clumps.append((centre, rng.uniform(0.44, 0.54)))
    return [(centre, share * radius) for centre, share in clumps]


def _place(
    spec: Tree | Building | CropRows | Road | Rubble | Fence | Person | Car | Tower, seed: str
) -> Thing:
    draw = random.Random(f"{seed}/place")
    if isinstance(spec, CropRows | Road | Fence):
        return Thing(spec, seed)
    x = spec.at[0] + draw.uniform(-spec.jitter, spec.jitter)
    y = spec.at[1] + draw.uniform(-spec.jitter, spec.jitter)
    yaw = draw.uniform(-math.pi, math.pi) if spec.yaw is None else math.radians(spec.yaw)
    height = 0.0
    if isinstance(spec, Tree):
        height = spec.height or draw.uniform(4.0, 9.0)
    elif isinstance(spec, Person):
        height = spec.height or draw.uniform(1.6, 1.88)
    elif isinstance(spec, Tower):
        height = spec.height
    motion = spec.motion if isinstance(spec, Person | Car) else None
    track = Track(motion, f"{seed}/track") if motion else None
    gestures = _timed(spec, draw) if isinstance(spec, Person) else ()
    return Thing(spec, seed, x, y, yaw, height, track, gestures)


def _timed(spec: Person, draw: random.Random) -> tuple[Gesture, ...]:
    """The person's gestures, each shifted at random within its jitter."""
    shifts = [draw.uniform(-gesture.jitter, gesture.jitter) for gesture in spec.gestures]
    return tuple(
        gesture.model_copy(update={"start": max(0.0, gesture.start + shift)})
        for gesture, shift in zip(spec.gestures, shifts, strict=True)
    )


def _scatter(
    spec: Trees, seed: str, obstacles: list[Box], roads: list[Road], walks: list[Motion]
) -> list[Thing]:
    """Place trees by rejection sampling; an area too crowded gets fewer than requested."""
    draw = random.Random(f"{seed}/scatter")
    lines = [(road.points, road.width / 2 + _TREE_GAP) for road in roads]
    lines += [(walk.points, 2 * _TREE_GAP) for walk in walks]
    west, south, east, north = spec.area
    result: list[Thing] = []
    for _ in range(20 * spec.count):
        if len(result) == spec.count:
            break
        x, y = draw.uniform(west, east), draw.uniform(south, north)
        height = draw.uniform(*spec.height)
        crowded = any(math.dist((x, y), (tree.x, tree.y)) < 1.2 * _TREE_GAP for tree in result)
        blocked = any(
            box.contains((x, y, box.centre[2]), CROWN_SHARE * height + 0.5) for box in obstacles
        )
        near = any(_distance((x, y), points) < gap for points, gap in lines)
        if not (crowded or blocked or near or _within((x, y), spec.clear)):
            tree = Tree(kind="tree", id=f"{spec.id}-{len(result)}", at=(x, y), height=height)
            yaw = draw.uniform(-math.pi, math.pi)
            result.append(Thing(tree, f"{seed}/{len(result)}", x, y, yaw, height))
    return result


def _within(place: tuple[float, float], area: tuple[float, float, float, float] | None) -> bool:
    if area is None:
        return False
    west, south, east, north = area
    return west <= place[0] <= east and south <= place[1] <= north


def _distance(place: tuple[float, float], points: list[tuple[float, float]]) -> float:
    """Distance from a place to the polyline through `points`."""
    return min(_distance_to_piece(place, here, there) for here, there in itertools.pairwise(points))


def _distance_to_piece(
    place: tuple[float, float], here: tuple[float, float], there: tuple[float, float]
) -> float:
    dx, dy = there[0] - here[0], there[1] - here[1]
    square = dx * dx + dy * dy
    share = 0.0
    if square > 0.0:
        share = ((place[0] - here[0]) * dx + (place[1] - here[1]) * dy) / square
        share = min(max(share, 0.0), 1.0)
    return math.dist(place, (here[0] + share * dx, here[1] + share * dy))


def _fence_boxes(spec: Fence) -> list[Box]:
    result = []
    for (x0, y0), (x1, y1) in itertools.pairwise(spec.points):
        centre = ((x0 + x1) / 2, (y0 + y1) / 2, spec.height / 2)
        size = (math.dist((x0, y0), (x1, y1)), 0.1, spec.height)
        result.append(Box(spec.id, "fence", centre, size, math.atan2(y1 - y0, x1 - x0)))
    return result


def _smooth(share: float) -> float:
    """Smooth step from 0 to 1."""
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)
