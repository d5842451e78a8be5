"""What a follower sees by: the true boxes with a detector's faults, or a detector on renders."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from aerodaas.analytics.base import Analytics, Context
from aerodaas.clock import seconds
from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.appearance import ZONE_BYTES, ZONES
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.scenario import Person
from aerodaas.simulation.world import Thing, World

__all__ = ["DetectorPerception", "Perception", "TruthPerception", "box_in_picture"]

_OUTLINE = np.array([0.92, 0.95])
"""Width and height of a person's or vest's outline in parts of the box in space around it."""
_SMALLEST = 4.0
"""Pixels; no detector finds less."""
_COLOUR_NOISE = 2.0
"""Standard deviation of a person's colours from one frame to the next, of 255."""
_ZONE_HIDDEN = 0.2
"""Part of the frames in which a zone of a person's appearance cannot be told."""
_HIDDEN = 0.6
"""Part of a box behind another person's body from which on it is not seen."""

Edges = tuple[float, float, float, float]


class Perception(Protocol):
    """Looks from a pose at a time."""

    def look(
        self, header: Header, pose: Odometry, believed: Odometry, context: Context
    ) -> Detections:
        """Boxes seen at `header.stamp` from the true `pose`; `believed` is the odometry told."""
        ...


def box_in_picture(
    thing: Thing, label: str, time: float, camera: CameraModel, pose: Odometry
) -> Edges | None:
    """Left, top, right and bottom of a thing's box, not clipped; None if it is behind."""
    turn = rotation_from_rpy(pose.roll, pose.pitch, pose.yaw)
    for box in thing.boxes(time):
        if box.label == label:
            corners = (box.corners - pose.position) @ turn
            pixels = np.array([camera.project(corner) for corner in corners])
            if (pixels[:, 2] <= 0).any():
                return None
            left, top = pixels[:, :2].min(axis=0)
            right, bottom = pixels[:, :2].max(axis=0)
            return float(left), float(top), float(right), float(bottom)
    return None


class TruthPerception:
    """Exact boxes of a thing and of people around it, with noise of edges and misses, by seed.

    Who is nearer hides who is farther: a box mostly behind another's body is not seen.
    """

    def __init__(
        self,
        thing: Thing,
        label: str,
        camera: CameraModel,
        *,
        bystanders: Sequence[tuple[Thing, str]] = (),
        seed: int,
        noise: float = 0.02,
        misses: float = 0.03,
        looks: bool = True,
    ) -> None:
        """`noise` is a standard deviation in parts of the box's height, `misses` a share.

        `thing` is seen with `label`, each of `bystanders` with its own; people have appearances if
        `looks`.
        """
        self._labels = [(thing, label), *bystanders]
        self._camera = camera
        self._noise, self._misses = noise, misses
        self._has_looks = looks
        self._random = np.random.default_rng(seed)
        self._colours = np.random.default_rng([seed, 1])

    def look(
        self, header: Header, pose: Odometry, believed: Odometry, context: Context
    ) -> Detections:
        """Return the boxes, unless they are missed, hidden or out of the picture."""
        del context
        camera, time = self._camera, seconds(header.stamp)
        items = []
        for thing, label in self._labels:
            edges = box_in_picture(thing, label, time, camera, pose)
            errors = self._random.normal(0, self._noise, 4)
            missed = self._random.random() < self._misses
            if edges is None or missed or self._is_hidden(thing, edges, time, pose):
                continue
            size = [camera.width, camera.height] * 2
            low, high = np.array(edges[:2]), np.array(edges[2:])
            middle, half = (low + high) / 2, _OUTLINE * (high - low) / 2
            outline = np.concatenate([middle - half, middle + half])
            noisy = np.clip(outline + errors * (edges[3] - edges[1]), 0, size)
            left, top, right, bottom = noisy.tolist()
            if min(right - left, bottom - top) > _SMALLEST:
                looks = self._looks(thing)
                items.append(Detection((left, top, right, bottom), label, 0.9, appearance=looks))
        return Detections(header, tuple(items), camera.width, camera.height, camera, believed)

    def _looks(self, thing: Thing) -> bytes | None:
        """Appearance of a person, drawn from their clothes, with noise and hidden zones."""
        if not (self._has_looks and isinstance(thing.spec, Person)):
            return None
        clothes = thing.spec.clothes
        worn = np.random.default_rng(list(thing.seed.encode()) if clothes is None else clothes)
        colours = worn.uniform(30, 220, (ZONES, ZONE_BYTES))
        noisy = colours + self._colours.normal(0, _COLOUR_NOISE, colours.shape)
        noisy[self._colours.random(ZONES) < _ZONE_HIDDEN] = 0.0
        return bytes(np.clip(noisy, 0, 255).astype(np.uint8).reshape(-1))

    def _is_hidden(self, thing: Thing, edges: Edges, time: float, pose: Odometry) -> bool:
        """Whether most of a box is behind the body of somebody nearer."""
        away = _distance(thing, time, pose)
        for other, _ in self._labels:
            if other is thing or _distance(other, time, pose) >= away:
                continue
            body = box_in_picture(other, "person", time, self._camera, pose)
            if body is not None and _covered(edges, body) > _HIDDEN:
                return True
        return False


class DetectorPerception:
    """A detector that looks at rendered pictures."""

    def __init__(
        self,
        world: World,
        camera: CameraModel,
        detector: Analytics[Detections],
        *,
        depth_range: float | None = None,
    ) -> None:
        """Open the renderer and the detector; the camera measures depth up to `depth_range` m."""
        # panda3d takes its time to load.
        from aerodaas.simulation.renderer import renderer_for  # noqa: PLC0415

        self._renderer = renderer_for(world, camera, depth_range)
        self._camera = camera
        self._detector = detector
        self.frame: Frame | None = None
        """As last seen."""
        detector.open()

    def look(
        self, header: Header, pose: Odometry, believed: Odometry, context: Context
    ) -> Detections:
        """Render and detect."""
        image = self._renderer.render(seconds(header.stamp), pose)
        self.frame = Frame(header, image, self._camera, believed, self._renderer.depth())
        found = self._detector.process(self.frame, context)
        return found if found is not None else Detections.of(self.frame, ())

    def close(self) -> None:
        """Free the renderer and the detector."""
        self._renderer.close()
        self._detector.close()


def _distance(thing: Thing, time: float, pose: Odometry) -> float:
    state = thing.state(time)
    return float(np.hypot(state.x - pose.position[0], state.y - pose.position[1]))


def _covered(box: Edges, by: Edges) -> float:
    """Part of `box` inside the box `by`."""
    across = min(box[2], by[2]) - max(box[0], by[0])
    down = min(box[3], by[3]) - max(box[1], by[1])
    area = (box[2] - box[0]) * (box[3] - box[1])
    return max(0.0, across) * max(0.0, down) / area if area > 0.0 else 0.0
