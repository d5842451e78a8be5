"""Random worlds to render, and where to look at them from."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.scenario import Car, Person, Scenario
from aerodaas.simulation.world import Thing, World
from tools.training.passers import ParkedCar, Passer

__all__ = ["View", "draw_camera", "draw_view", "draw_world"]

_WIDTH = 640
"""Pixels: more than the networks' input, so that what is kept is free of jagged edges."""

_SHAPES = ((360, 0.55), (480, 0.35), (640, 0.1))
"""Heights of pictures and their shares: 16:9, 4:3, square."""

_WANTED = ("vest", "person", "car", "tower", "tree", "building")
_SHARES = (0.36, 0.24, 0.19, 0.10, 0.05, 0.06)
"""What pictures are taken of; walls and windows, close up, have been taken for vests and cars."""

_AIMLESS = 0.08
"""Share of pictures that a drone takes on its way, of nothing in particular: roads, shadows and
walls close by have been taken for cars."""

_IN_VESTS = 0.45
"""Share of the people."""

_EDGE = 45.0
"""Metres from the middle to the edge of what stands around."""


@dataclass(frozen=True)
class View:
    """A moment and a place to look from."""

    time: float
    pose: Odometry


def draw_camera(rng: np.random.Generator) -> CameraModel:
    """Return a lens of 45 to 95 degrees."""
    height = _SHAPES[rng.choice(len(_SHAPES), p=[share for _, share in _SHAPES])][0]
    return CameraModel.from_fov(_WIDTH, height, math.radians(rng.uniform(45, 95)))


def draw_world(seed: int) -> World:
    """Return a world of people, cars, perhaps a tower, and what stands around them."""
    rng = np.random.default_rng(seed)
    entities: list[dict[str, object]] = []

    def place(least: float = 0.0, most: float = _EDGE) -> tuple[float, float]:
        reach, angle = rng.uniform(least, most), rng.uniform(-math.pi, math.pi)
        return reach * math.cos(angle), reach * math.sin(angle)

    for k in range(rng.integers(1, 8)):
        vest = "any" if rng.random() < _IN_VESTS else "none"
        entities.append({"kind": "person", "id": f"person{k}", "at": place(0, 8), "vest": vest})
    for k in range(rng.integers(0, 4)):
        colour = tuple(rng.uniform(0, 1, 3)) if rng.integers(2) else (rng.uniform(),) * 3
        entities.append({"kind": "car", "id": f"car{k}", "at": place(3, 25), "colour": colour})
    if rng.random() < 0.55:  # noqa: PLR2004 - about half
        mast = {"kind": "tower", "id": "tower", "at": place(10, 40)}
        entities.append({**mast, "height": rng.uniform(8, 45), "width": rng.uniform(1.0, 4.5)})
    for k in range(rng.integers(0, 14)):
        tree = {"kind": "tree", "id": f"tree{k}", "at": place(9), "height": rng.uniform(2, 14)}
        entities.append(tree)
    for k in range(rng.integers(0, 4)):
        size = (rng.uniform(3, 20), rng.uniform(3, 14), rng.uniform(2.4, 10))
        roof = ("gable", "flat")[rng.integers(2)]
        house = {"kind": "building", "id": f"house{k}", "at": place(9), "size": size}
        entities.append({**house, "roof": roof})
    for k in range(rng.integers(0, 3)):
        way = [place(5), place(0, 10), place(5)]
        surface = ("asphalt", "gravel", "soil")[rng.integers(3)]
        road = {"kind": "road", "id": f"road{k}", "points": way, "width": rng.uniform(1.5, 8)}
        entities.append({**road, "surface": surface})
    if rng.random() < 0.25:  # noqa: PLR2004 - a quarter
        west, south = place(0, 20)
        area = (west, south, west + rng.uniform(8, 20), south + rng.uniform(4, 12))
        crops = {"kind": "crop_rows", "id": "crops", "area": area}
        entities.append({**crops, "height": rng.uniform(0.1, 0.9)})
    if rng.integers(2):
        entities.append({"kind": "fence", "id": "fence", "points": [place(4), place(4)]})
    surface = ("grass", "soil", "asphalt")[rng.integers(3)]
    sky = {"sun_elevation": rng.uniform(15, 80), "clouds": rng.uniform(0, 1)}
    description = {
        "name": "random",
        "ground": {"surface": surface},
        "sky": sky,
        "entities": entities,
    }
    world = World(Scenario.model_validate(description), seed)
    world.things = tuple(_restless(thing, rng) for thing in world.things)
    return world


def _restless(thing: Thing, rng: np.random.Generator) -> Thing:
    """Let a person or a car stand elsewhere at each second."""
    values = {field.name: getattr(thing, field.name) for field in fields(thing)}
    if isinstance(thing.spec, Person):
        values["height"] = rng.uniform(1.2, 1.95)
        return Passer(**values, around=(0.0, 0.0), radius=7.0)
    if isinstance(thing.spec, Car):
        return ParkedCar(**values, around=(thing.x, thing.y), radius=8.0)
    return thing


def draw_view(world: World, camera: CameraModel, time: float, rng: np.random.Generator) -> View:
    """Choose a thing to look at, and a place to see it from at `time`; or look about on the way."""
    if rng.random() < _AIMLESS:
        return _on_the_way(time, rng)
    wanted = rng.choice(_WANTED, p=_SHARES)
    boxes = [box for box in world.boxes(time) if box.label == wanted] or world.boxes(time)
    target = boxes[rng.integers(len(boxes))]
    size = max(target.size)
    # What share of the picture's height the target takes.
    share = math.exp(rng.uniform(math.log(0.07), math.log(1.3)))
    distance = max(size * camera.fy / (share * camera.height), 0.7 + 0.5 * max(target.size[:2]))
    distance = min(distance, 90.0)
    steep = rng.uniform(-0.08, 0.22) if rng.random() < 0.62 else rng.uniform(0.0, 1.25)  # noqa: PLR2004
    bearing = rng.uniform(-math.pi, math.pi)
    if wanted == "car" and rng.integers(2):
        # As seen from a car behind or ahead of it.
        bearing = target.yaw + rng.normal(0.0, 0.25) + math.pi * rng.integers(2)
    x = target.centre[0] - distance * math.cos(steep) * math.cos(bearing)
    y = target.centre[1] - distance * math.cos(steep) * math.sin(bearing)
    z = min(max(target.centre[2] + distance * math.sin(steep), 0.5), 40.0)
    dx, dy, dz = target.centre[0] - x, target.centre[1] - y, target.centre[2] - z
    across, above = np.clip(rng.normal(0.0, 0.22, 2), -0.42, 0.42)
    across *= camera.width / camera.fx
    above *= camera.height / camera.fy
    yaw = math.atan2(dy, dx) + math.atan(across)
    pitch = math.atan2(-dz, math.hypot(dx, dy)) + math.atan(above)
    roll = rng.normal(0.0, 0.07)
    return View(time, Odometry(np.array([x, y, z]), np.zeros(3), yaw, roll, pitch))


def _on_the_way(time: float, rng: np.random.Generator) -> View:
    place = np.array([*rng.uniform(-25.0, 25.0, 2), rng.uniform(1.2, 6.0)])
    yaw, roll = rng.uniform(-math.pi, math.pi), rng.normal(0.0, 0.05)
    return View(time, Odometry(place, np.zeros(3), yaw, roll, rng.uniform(-0.05, 0.45)))
