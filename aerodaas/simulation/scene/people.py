"""Scene nodes of people: limbs between the joints of the skeleton, clothes, hazard vests."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from panda3d.core import LMatrix4f, NodePath, Texture

from aerodaas.simulation.scenario import Person
from aerodaas.simulation.scene.layers import LABEL, attach
from aerodaas.simulation.scene.mesh import Mesh, blob, merged, tube
from aerodaas.simulation.scene.textures import Palette, VestCut, vest_texture
from aerodaas.simulation.skeleton import JOINTS, LIMBS
from aerodaas.simulation.world import Thing

__all__ = ["Garment", "Outfit", "PersonFigure"]

Colour: TypeAlias = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""

_VESTS = {
    "yellow": (0.93, 0.96, 0.12),
    "lime": (0.70, 0.98, 0.18),
    "orange": (1.00, 0.44, 0.08),
    "pink": (1.00, 0.22, 0.55),
}
_SKINS = ((0.95, 0.78, 0.66), (0.82, 0.62, 0.46), (0.60, 0.42, 0.30), (0.40, 0.28, 0.20))
_HAIRS = ((0.10, 0.08, 0.07), (0.25, 0.16, 0.09), (0.45, 0.32, 0.18), (0.55, 0.53, 0.50))
_SHIRTS = (
    (0.20, 0.30, 0.55),
    (0.55, 0.16, 0.16),
    (0.90, 0.90, 0.88),
    (0.16, 0.17, 0.19),
    (0.25, 0.42, 0.28),
    (0.72, 0.60, 0.42),
    (0.48, 0.50, 0.54),
)
_TROUSERS = ((0.14, 0.17, 0.28), (0.22, 0.22, 0.23), (0.42, 0.36, 0.28), (0.30, 0.36, 0.46))
_SHOES = (0.12, 0.11, 0.11)

_RADII = {
    "shoulder": (0.062, 0.048),
    "elbow": (0.046, 0.036),
    "hip": (0.098, 0.066),
    "knee": (0.064, 0.048),
    "ankle": (0.050, 0.042),
}
"""Radii in metres at the beginning and end of the limb that starts at this joint."""

_REFERENCE_HEIGHT = 1.75
_CHEST_RADII = np.array([0.155, 0.165, 0.185, 0.215, 0.205, 0.09])
_CHEST_LEVELS = np.array([-0.04, 0.15, 0.5, 0.78, 0.92, 1.02])
"""Levels of the torso's radii, from the pelvis (0) to the neck (1)."""

_ABOVE = np.array([0.35, 0.2, 0.91])
"""Direction of the light: as it is baked in and figures turn, from above and slightly ahead."""


@dataclass(frozen=True)
class Garment:
    """Garment around the torso, where it is no plain shirt and no vest."""

    texture: Texture
    """u runs once around from the back, v from the hem to the neck."""
    hem: float = 0.04
    """Overhang below the pelvis, as a fraction of the torso."""
    flare: float = 0.0
    """Distance of the hem from the body, metres."""


@dataclass(frozen=True)
class Outfit:
    """Appearance of a person."""

    skin: Colour
    hair: Colour
    shirt: Colour
    trousers: Colour
    shoes: Colour = _SHOES
    bare_arms: bool = False
    """Whether the forearms are without sleeves."""
    bare_shoulders: bool = False
    """Whether the upper arms are without sleeves."""
    garment: Garment | None = None
    """Instead of the plain shirt, of those without a vest."""
    vest: VestCut | None = None
    build: float = 1.0
    """Girth relative to an average adult's."""

    @classmethod
    def draw(cls, spec: Person, rng: np.random.Generator) -> Outfit:
        """Draw the outfit of a person of a scenario.

        Args:
            spec: The person, whose vest may be given.
            rng: Source of randomness.
        """
        skin, hair = _choose(rng, _SKINS), _choose(rng, _HAIRS)
        shirt, trousers = _choose(rng, _SHIRTS), _choose(rng, _TROUSERS)
        vest = spec.vest if spec.vest != "any" else str(rng.choice(sorted(_VESTS)))
        cut = None if vest == "none" else VestCut(_VESTS[vest])
        return cls(skin, hair, shirt, trousers, bare_arms=not rng.integers(2), vest=cut)


class PersonFigure:
    """Scene nodes of one person, posed for each image."""

    def __init__(self, parent: NodePath, thing: Thing, palette: Palette, wear: Outfit) -> None:
        """Build the person with the outfit `wear`."""
        spec = thing.spec
        if not isinstance(spec, Person):
            raise TypeError(f"{thing.id} is no person")
        forearm = wear.skin if wear.bare_arms else wear.shirt
        upper_arm = wear.skin if wear.bare_shoulders else wear.shirt
        clothes = (upper_arm, forearm, wear.trousers, wear.trousers, wear.shoes)
        self._root = parent.attach_new_node(spec.id)
        self._root.set_tag(LABEL, f"{spec.id}/person")
        self._scale = thing.height / _REFERENCE_HEIGHT
        self._nodes: list[NodePath] = []
        self._bones: list[tuple[int, int]] = []
        plain = palette["plain"]
        colours = dict(zip(_RADII, clothes, strict=True))
        for upper, lower in LIMBS:
            joint = upper.split("_")[1]
            limb = _limb(*_RADII[joint]).moved((0, 0, 0), scale=(wear.build, wear.build, 1.0))
            limb = limb.painted(colours[joint])
            if joint == "elbow":
                limb = merged([limb, _hand().painted(wear.skin)])
            self._add((upper, lower), limb, plain)
        self._add(("neck", "head"), _head(wear.skin, wear.hair), plain)
        self._add(("pelvis", "neck"), _hips(wear.build).painted(wear.trousers), plain)
        if wear.vest is not None:
            self._wear(wear.vest, wear)
        elif wear.garment is not None:
            around = _around(wear.garment.hem, wear.garment.flare, wear.build)
            self._add(("pelvis", "neck"), around, wear.garment.texture)
        else:
            self._add(("pelvis", "neck"), _torso(wear.build).painted(wear.shirt), plain)

    def _wear(self, cut: VestCut, wear: Outfit) -> None:
        around = _around(cut.hem, cut.flare, wear.build)
        node = self._add(("pelvis", "neck"), around, vest_texture(cut, wear.shirt))
        node.set_tag(LABEL, f"{self._root.name}/vest")

    def _add(self, bone: tuple[str, str], mesh: Mesh, texture: Texture) -> NodePath:
        node = attach(self._root, bone[1], mesh.lit(_ABOVE), texture)
        self._nodes.append(node)
        self._bones.append((JOINTS.index(bone[0]), JOINTS.index(bone[1])))
        return node

    def pose(self, joints: NDArray[np.float64], yaw: float) -> None:
        """Place the limbs between `joints`.

        Args:
            joints: ENU metres, (len(JOINTS), 3).
            yaw: Where the person faces, radians counter-clockwise from east.
        """
        starts, ends = np.array(self._bones).T
        along = joints[ends] - joints[starts]
        # The front of a limb pointing straight ahead is undefined, so the reference is tilted.
        forward = np.array([math.cos(yaw), math.sin(yaw), 1e-4])
        ahead = forward - along * ((along @ forward) / np.sum(along * along, axis=1))[:, None]
        ahead *= self._scale / np.linalg.norm(ahead, axis=1, keepdims=True)
        left = np.cross(along, ahead) / np.linalg.norm(along, axis=1, keepdims=True)
        matrices = np.zeros((len(starts), 4, 4))
        matrices[:, 0, :3], matrices[:, 1, :3] = ahead, left
        matrices[:, 2, :3], matrices[:, 3, :3] = along, joints[starts]
        matrices[:, 3, 3] = 1.0
        for node, matrix in zip(self._nodes, matrices.reshape(-1, 16).tolist(), strict=True):
            node.set_mat(LMatrix4f(*matrix))

    def show(self, *, present: bool) -> None:
        """Show or hide the person."""
        if present:
            self._root.show()
        else:
            self._root.hide()


def _choose(rng: np.random.Generator, colours: tuple[Colour, ...]) -> Colour:
    return colours[rng.integers(len(colours))]


def _limb(start: float, end: float) -> Mesh:
    """A tapered limb of length 1 along z, with rounded ends."""
    return tube([start * 0.6, start, end, end * 0.6], [-0.06, 0.04, 0.94, 1.03], sides=6)


def _hand() -> Mesh:
    """A hand at the end of a forearm of length 1."""
    return blob(0.05, rings=5, sides=6).moved((0.0, 0.0, 1.1), scale=(0.75, 0.55, 4.0))


def _torso(build: float) -> Mesh:
    """Chest and belly of length 1 from the pelvis to the neck, flatter than wide."""
    return tube(_CHEST_RADII * _girth(build), _CHEST_LEVELS, sides=12, flatten=0.62)


def _around(hem: float, flare: float, build: float) -> Mesh:
    """Mesh of a garment around a torso, whose hem stands off the body."""
    radii, levels = _CHEST_RADII * _girth(build), _CHEST_LEVELS.copy()
    radii[:2] += flare
    levels[0] = -hem
    return tube(radii, levels, sides=12, flatten=0.62)


def _girth(build: float) -> NDArray[np.float64]:
    """Factors of a torso's radii by build; shoulders and neck vary less than the belly."""
    return 1.0 + (build - 1.0) * np.array([1.0, 1.0, 0.9, 0.5, 0.4, 0.2])


def _hips(build: float) -> Mesh:
    girth = np.array([0.10, 0.165, 0.16]) * build
    return tube(girth, [-0.20, -0.08, 0.02], sides=10, flatten=0.68)


def _head(skin: Colour, hair: Colour) -> Mesh:
    """Neck, face and hair; z runs from the neck joint (0) to the middle of the head (1)."""
    stretch = 1.0 / 0.15
    neck = tube([0.055, 0.05], [-0.35, 0.6], sides=7).painted(skin)
    face = blob(0.098, rings=8, sides=10).moved((0, 0, 0), scale=(1.0, 0.82, 1.22 * stretch))
    face = face.painted(skin).moved((0, 0, 1.0))
    cap = blob(0.106, rings=8, sides=10)
    x, _, z = cap.points[cap.triangles].mean(axis=1).T
    hairline, nape = 0.058, -0.055
    hairy = (z > hairline) | ((x < 0.0) & (z > nape))
    cap = Mesh(cap.points, cap.uv, cap.normals, cap.colours, cap.triangles[hairy])
    cap = cap.moved((0, 0, 0), scale=(1.0, 0.84, 1.2 * stretch)).painted(hair)
    return merged([neck, face, cap.moved((-0.004, 0, 1.04))])
