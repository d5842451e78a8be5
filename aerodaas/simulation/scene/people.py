"""People: limbs between the joints of the skeleton, clothes, hazard vests."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from panda3d.core import LMatrix4f, NodePath, Texture

from aerodaas.simulation.scenario import Person
from aerodaas.simulation.scene.layers import attach
from aerodaas.simulation.scene.mesh import Mesh, blob, merged, tube
from aerodaas.simulation.scene.plants import rng_of
from aerodaas.simulation.scene.textures import Palette, vest_texture
from aerodaas.simulation.skeleton import JOINTS, LIMBS
from aerodaas.simulation.world import Thing

__all__ = ["PersonFigure"]

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
"""Metres at the beginning and the end of the limb that starts at this joint."""

_REFERENCE_HEIGHT = 1.75

_ABOVE = np.array([0.35, 0.2, 0.91])
"""A figure turns while its light is baked in, so all are lit from above, a little ahead."""


class PersonFigure:
    """The nodes of one person, posed anew for each picture."""

    def __init__(self, parent: NodePath, thing: Thing, palette: Palette) -> None:
        """Dress the person by its seed."""
        spec = thing.spec
        if not isinstance(spec, Person):
            raise TypeError(f"{thing.id} is no person")
        rng = rng_of(thing)
        skin, hair = _choose(rng, _SKINS), _choose(rng, _HAIRS)
        shirt, trousers = _choose(rng, _SHIRTS), _choose(rng, _TROUSERS)
        vest = spec.vest if spec.vest != "any" else str(rng.choice(sorted(_VESTS)))
        forearm = shirt if rng.integers(2) else skin
        colours = dict(zip(_RADII, (shirt, forearm, trousers, trousers, _SHOES), strict=True))
        self._root = parent.attach_new_node(spec.id)
        self._scale = thing.height / _REFERENCE_HEIGHT
        self._nodes: list[NodePath] = []
        self._bones: list[tuple[int, int]] = []
        plain = palette["plain"]
        for upper, lower in LIMBS:
            joint = upper.split("_")[1]
            limb = _limb(*_RADII[joint]).painted(colours[joint])
            if joint == "elbow":
                limb = merged([limb, _hand().painted(skin)])
            self._add((upper, lower), limb, plain)
        self._add(("neck", "head"), _head(skin, hair), plain)
        self._add(("pelvis", "neck"), _hips().painted(trousers), plain)
        if vest == "none":
            self._add(("pelvis", "neck"), _torso().painted(shirt), plain)
        else:
            self._add(("pelvis", "neck"), _torso(), vest_texture(_VESTS[vest]))

    def _add(self, bone: tuple[str, str], mesh: Mesh, texture: Texture) -> None:
        self._nodes.append(attach(self._root, bone[1], mesh.lit(_ABOVE), texture))
        self._bones.append((JOINTS.index(bone[0]), JOINTS.index(bone[1])))

    def pose(self, joints: NDArray[np.float64], yaw: float) -> None:
        """Put the limbs between `joints` (len(JOINTS), 3), ENU metres."""
        starts, ends = np.array(self._bones).T
        along = joints[ends] - joints[starts]
        # A limb that points straight ahead has no front of its own; lean the reference a little.
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


def _choose(
    rng: np.random.Generator, colours: tuple[tuple[float, float, float], ...]
) -> tuple[float, float, float]:
    return colours[rng.integers(len(colours))]


def _limb(start: float, end: float) -> Mesh:
    """A tapered limb of length 1 along z, with rounded ends."""
    return tube([start * 0.6, start, end, end * 0.6], [-0.06, 0.04, 0.94, 1.03], sides=6)


def _hand() -> Mesh:
    """A hand beyond the end of a forearm of length 1."""
    return blob(0.05, rings=5, sides=6).moved((0.0, 0.0, 1.1), scale=(0.75, 0.55, 4.0))


def _torso() -> Mesh:
    """Chest and belly of length 1 from the pelvis to the neck, flatter than wide."""
    return tube(
        [0.155, 0.165, 0.185, 0.215, 0.205, 0.09],
        [-0.04, 0.15, 0.5, 0.78, 0.92, 1.02],
        sides=12,
        flatten=0.62,
    )


def _hips() -> Mesh:
    return tube([0.10, 0.165, 0.16], [-0.20, -0.08, 0.02], sides=10, flatten=0.68)


def _head(skin: tuple[float, float, float], hair: tuple[float, float, float]) -> Mesh:
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
