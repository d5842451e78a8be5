"""Bodies as the shipped networks find them: postures rendered, detected, their joints found.

What a classifier of gestures must cope with is not noise at random, but a detector's boxes that
leave out an arm, and a network that is unsure of a foot.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.gestures import GESTURES
from aerodaas.analytics.models import DETECTOR_CLASSES
from aerodaas.analytics.pose import PoseAnalytics
from aerodaas.data import Detection, Frame, Header, Odometry
from aerodaas.geometry import CameraModel
from aerodaas.simulation.scenario import Person
from aerodaas.simulation.scene.scene import Looks
from aerodaas.simulation.world import World
from aerodaas.training.augment import spoiled
from aerodaas.training.bodies import sample_body
from aerodaas.training.labelling import Label, LabellingRenderer
from aerodaas.training.looks import VariousLooks
from aerodaas.training.metrics import overlap
from aerodaas.training.passers import Passer
from aerodaas.training.scenes import draw_world

__all__ = ["found_bodies"]

_VIEWS = 24
"""Pictures of one world, a gesture after the other."""

_PERSON = DETECTOR_CLASSES.index("person")
_SAME = 0.3
"""Intersection over union from which a box is of the person who was rendered."""


@dataclass(frozen=True)
class _Poser(Passer):
    """A person who shows the next gesture at each full second."""

    def joints(self, time: float) -> NDArray[np.float64]:
        """Joints of a posture drawn for this second."""
        state = self.state(time)
        rng = np.random.default_rng([zlib.crc32(str(self.seed).encode()), int(time)])
        body = sample_body(rng, _gesture(time))
        c, s = math.cos(state.yaw), math.sin(state.yaw)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(body @ turn + np.array([state.x, state.y, 0.0]))


def _gesture(time: float) -> str:
    return GESTURES[int(time) % len(GESTURES)]


def found_bodies(
    pose: PoseAnalytics, first: int, worlds: int
) -> Iterator[tuple[NDArray[np.float32], str]]:
    """Keypoints (17, 3) that `pose`, opened, finds, and the gesture; worlds from seed `first`."""
    for seed in range(first, first + worlds):
        rng = np.random.default_rng([seed, 4])
        world = draw_world(seed)
        people = [thing for thing in world.things if isinstance(thing.spec, Person)]
        values = {field.name: getattr(people[0], field.name) for field in fields(people[0])}
        others = tuple(thing for thing in world.things if thing not in people)
        world.things = (*others, _Poser(**values))
        yield from _looks_at(pose, world, rng)


def _looks_at(
    pose: PoseAnalytics, world: World, rng: np.random.Generator
) -> Iterator[tuple[NDArray[np.float32], str]]:
    lens = math.radians(rng.uniform(50, 95))
    camera = CameraModel.from_fov(640, 360, lens)
    looks = Looks() if rng.integers(2) else VariousLooks()
    renderer = LabellingRenderer(world, camera, looks)
    for step in range(_VIEWS):
        view = _view(world, float(step), rng)
        image = renderer.render(float(step), view)
        label = next((one for one in renderer.labels(step, view) if one.kind == _PERSON), None)
        if label is None:
            continue
        found = pose.detect(Frame(Header(step, step, "rendered"), spoiled(image, rng)))
        body = _match(list(found), label)
        if body is not None and body.keypoints is not None:
            yield np.asarray(body.keypoints, np.float32), _gesture(step)
    renderer.close()


def _view(world: World, time: float, rng: np.random.Generator) -> Odometry:
    """Look at the person as a drone that follows does, from all sides."""
    box = next(box for box in world.boxes(time) if box.label == "person")
    x, y, z = box.centre
    distance, bearing = 1.2 * math.exp(rng.uniform(0, 1.8)), rng.uniform(-math.pi, math.pi)
    east, north = x - distance * math.cos(bearing), y - distance * math.sin(bearing)
    up = rng.uniform(0.9, 3.0)
    yaw = bearing + rng.normal(0.0, 0.12)
    pitch = math.atan2(up - z, distance) + rng.normal(0.0, 0.12)
    return Odometry(np.array([east, north, up]), np.zeros(3), yaw, rng.normal(0.0, 0.05), pitch)


def _match(found: list[Detection], label: Label) -> Detection | None:
    if not found:
        return None
    boxes = np.array([one.box for one in found], dtype=float)
    shares = overlap(boxes, label.box[None].astype(float))[:, 0]
    best = int(shares.argmax())
    return found[best] if shares[best] >= _SAME else None
