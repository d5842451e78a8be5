"""Pictures with exact labels: which pixel shows what, and from that boxes and keypoints."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from panda3d.core import (
    Camera,
    ColorAttrib,
    ColorScaleAttrib,
    LVecBase4f,
    NodePath,
    RenderState,
    TextureAttrib,
    TransparencyAttrib,
)

from aerodaas.analytics.models import DETECTOR_CLASSES
from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.renderer import Renderer
from aerodaas.simulation.scene.layers import LABEL
from aerodaas.simulation.scene.scene import ObjectAppearance
from aerodaas.simulation.scene.textures import Palette
from aerodaas.simulation.world import World

__all__ = ["Label", "LabellingRenderer", "box_of", "mask_of", "project", "visibility"]

_STEP = 8
"""Between the codes of two things, in grey levels: rounding confuses no two."""

_ROW = 30
"""Codes per channel."""

_OVERRIDE = 100
"""Precedence over the states of nodes."""

_LEAST_SHARE = {"vest": 0.09, "person": 0.07, "car": 0.12, "tower": 0.03}
"""Share of the projection of the box in space that must be seen; wholly seen, it is 0.2 to 0.9."""


@dataclass(frozen=True)
class Label:
    """One thing in a picture."""

    kind: int
    """Index in DETECTOR_CLASSES."""
    box: NDArray[np.float64]
    """Left, top, right, bottom of the visible pixels."""
    keypoints: NDArray[np.float64] | None = None
    """A person's (17, 3): u, v, and 0 (outside the picture), 1 (hidden) or 2 (visible)."""


class LabellingRenderer(Renderer):
    """Renders the picture and, beside it, the number of the thing that each pixel shows."""

    def __init__(
        self, world: World, camera: CameraModel, appearance: ObjectAppearance | None = None
    ) -> None:
        """Build the scene, and a second buffer that shares its camera."""
        super().__init__(world, camera, appearance)
        self._world = world
        self.things = _labelled(self._scene.root)
        self._codes = self._open(self._eye.attach_new_node(self._code_camera()), np.zeros(3))

    @property
    def scene(self) -> NodePath:
        """The root of the scene, for things that no scenario knows."""
        return self._scene.root

    @property
    def palette(self) -> Palette:
        """The textures of the scene."""
        return self._scene.palette

    def _code_camera(self) -> Camera:
        eye = Camera("codes", self._eye.node().get_lens())
        # Unlabelled things are black, yet keeps the holes of its texture.
        black = ColorScaleAttrib.make(LVecBase4f(0, 0, 0, 1))
        eye.set_initial_state(RenderState.make(black, _OVERRIDE))
        eye.set_tag_state_key(LABEL)
        for number, name in enumerate(self.things):
            red, green = number % _ROW + 1, number // _ROW
            colour = LVecBase4f(red * _STEP / 255, green * _STEP / 255, 0, 1)
            state = RenderState.make(ColorAttrib.make_flat(colour), _OVERRIDE)
            state = state.add_attrib(TextureAttrib.make_all_off(), _OVERRIDE)
            state = state.add_attrib(ColorScaleAttrib.make_off(), _OVERRIDE + 1)
            state = state.add_attrib(TransparencyAttrib.make(TransparencyAttrib.M_none), _OVERRIDE)
            eye.set_tag_state(name, state)
        return eye

    def numbers(self) -> NDArray[np.uint8]:
        """Of the last picture: (height, width), 1 + index in `things` of what is seen, or 0."""
        shape = (self._camera.height, self._camera.width, 4)
        codes = np.frombuffer(self._codes.get_ram_image(), np.uint8).reshape(shape)
        red, green = cv2.flip(codes[..., 2], 0), cv2.flip(codes[..., 1], 0)
        row, column = (green + _STEP // 2) // _STEP, (red + _STEP // 2) // _STEP
        return np.where(column > 0, _ROW * row + column, 0).astype(np.uint8)

    def labels(self, time: float, pose: Odometry) -> list[Label]:
        """Label what the last picture, rendered with the same arguments, shows.

        What is almost wholly hidden gets no label.
        """
        numbers = self.numbers()
        present = set(np.flatnonzero(np.bincount(numbers.ravel(), minlength=256)).tolist())
        result = []
        for name, members in _members(self.things).items():
            if present.isdisjoint(members):
                continue
            entity, kind = name.split("/")
            shown = mask_of(numbers, members)
            box = box_of(shown)
            if box is None or not self._shows(entity, kind, time, pose, shown):
                continue
            keypoints = None
            if kind == "person":
                points = self._world.thing(entity).keypoints(time)
                keypoints = visibility(project(self._camera, pose, points), shown)
            result.append(Label(DETECTOR_CLASSES.index(kind), box, keypoints))
        return result

    def _shows(
        self,
        entity: str,
        kind: str,
        time: float,
        pose: Odometry,
        shown: NDArray[np.bool_],
    ) -> bool:
        """Whether enough of a thing is seen, measured by the box in space around it."""
        box = next(box for box in self._world.thing(entity).boxes(time) if box.label == kind)
        pixels = project(self._camera, pose, box.corners)
        if np.isnan(pixels).any():
            return True
        size = (self._camera.width, self._camera.height)
        low, high = np.clip(pixels.min(axis=0), 0, size), np.clip(pixels.max(axis=0), 0, size)
        return bool(np.count_nonzero(shown) >= _LEAST_SHARE[kind] * float(np.prod(high - low)))


def _labelled(root: NodePath) -> list[str]:
    """Labels of all nodes that bear one, in the scene's order."""
    nodes = root.find_all_matches(f"**/={LABEL}")
    return list(dict.fromkeys(node.get_tag(LABEL) for node in nodes))


def _members(things: list[str]) -> dict[str, list[int]]:
    """Numbers of what belongs to each label: a vest is part of its person, too."""
    result: dict[str, list[int]] = {name: [number] for number, name in enumerate(things, 1)}
    for number, name in enumerate(things, 1):
        entity, kind = name.split("/")
        if kind == "vest":
            result[f"{entity}/person"].append(number)
    return result


def mask_of(numbers: NDArray[np.uint8], members: list[int]) -> NDArray[np.bool_]:
    """Where one of `members` is seen."""
    shown = numbers == members[0]
    for number in members[1:]:
        shown |= numbers == number
    return shown


def box_of(shown: NDArray[np.bool_], least: int = 6) -> NDArray[np.float64] | None:
    """Box (left, top, right, bottom) around the true pixels of (height, width) `shown`.

    None if it is narrower or lower than `least` pixels.
    """
    left, top, width, height = cv2.boundingRect(shown.view(np.uint8))
    if min(width, height) < least:
        return None
    return np.array([left, top, left + width, top + height], dtype=np.float64)


def project(
    camera: CameraModel, pose: Odometry, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Pixels (n, 2) of ENU points (n, 3); NaN behind the camera."""
    body = (points - pose.position) @ rotation_from_rpy(pose.roll, pose.pitch, pose.yaw)
    x, y, depth = ((body - np.array(camera.mount)) @ camera.body_from_optical).T
    depth = np.where(depth > 0.0, depth, np.nan)
    return np.stack([camera.fx * x / depth + camera.cx, camera.fy * y / depth + camera.cy], -1)


def visibility(pixels: NDArray[np.float64], shown: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return (n, 3): u, v, and 2 where `shown` is true, 1 where not, 0 outside the picture."""
    height, width = shown.shape
    result = np.zeros((len(pixels), 3))
    with np.errstate(invalid="ignore"):
        inside = ((pixels >= 0) & (pixels < (width, height))).all(axis=1)
    u, v = pixels[inside].astype(np.int64).T
    result[inside, :2] = pixels[inside]
    result[inside, 2] = 1 + shown[v, u]
    return result
