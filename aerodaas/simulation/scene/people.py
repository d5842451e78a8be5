"""People: limbs between the joints of the skeleton, clothes, hazard vests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from panda3d.core import LMatrix4f, NodePath

from aerodaas.simulation.scenario import Person
from aerodaas.simulation.scene.layers import attach
from aerodaas.simulation.scene.light import Light
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


class PersonFigure:
    """The nodes of one person, posed anew for each picture."""

    def __init__(self, parent: NodePath, thing: Thing, palette: Palette, light: Light) -> None:
        """Dress the person by its seed."""
        spec = thing.spec
        if not isinstance(spec, Person):
            raise TypeError(f"{thing.id} is no person")
        rng = rng_of(thing)
        skin = _SKINS[rng.integers(len(_SKINS))]
        hair = _HAIRS[rng.integers(len(_HAIRS))]
        shirt = _SHIRTS[rng.integers(len(_SHIRTS))]
        trousers = _TROUSERS[rng.integers(len(_TROUSERS))]
        sleeves = rng.random() < 0.5
        self._root = parent.attach_new_node(spec.id)
        self._nodes: list[tuple[NodePath, int, int, float]] = []
        scale = thing.height / _REFERENCE_HEIGHT
        for upper, lower in LIMBS:
            joint = upper.split("_")[1]
            colour = {
                "shoulder": shirt,
                "elbow": shirt if sleeves else skin,
                "hip": trousers,
                "knee": trousers,
                "ankle": _SHOES,
            }[joint]
            mesh = _limb(*_RADII[joint], hand=skin if joint == "elbow" else None).painted(1.0)
            self._add(upper, lower, _coloured(mesh, colour), palette, light, scale)
        self._add("neck", "head", _head(skin, hair), palette, light, scale)
        torso = _torso()
        if spec.vest == "none":
            self._add("pelvis", "neck", _coloured(torso, shirt), palette, light, scale)
        else:
            name = spec.vest if spec.vest != "any" else str(rng.choice(sorted(_VESTS)))
            self._add("pelvis", "neck", torso, palette, light, scale, _VESTS[name])
        self._add("pelvis", "neck", _coloured(_hips(), trousers), palette, light, scale)

    def _add(
        self,
        start: str,
        end: str,
        mesh: Mesh,
        palette: Palette,
        light: Light,
        scale: float,
        vest: tuple[float, float, float] | None = None,
    ) -> None:
        # The figure turns while its light is baked in, so the light comes from above for all.
        above = np.array([0.35, 0.2, 0.91]) if light.elevation > 0.0 else np.array([0, 0, 1.0])
        texture = palette["plain"] if vest is None else vest_texture(vest)
        node = attach(self._root, end, mesh.lit(above), texture)
        self._nodes.append((node, JOINTS.index(start), JOINTS.index(end), scale))

    def pose(self, joints: NDArray[np.float64], yaw: float, *, present: bool) -> None:
        """Put the limbs between `joints` (len(JOINTS), 3), ENU metres."""
        if not present:
            self._root.hide()
            return
        self._root.show()
        forward = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        for node, start, end, scale in self._nodes:
            along = joints[end] - joints[start]
            side = np.cross(along, forward)
            size = np.linalg.norm(side)
            # A limb that points straight ahead has no front of its own; any side will do.
            side = side / size if size > 1e-6 else np.array([-np.sin(yaw), np.cos(yaw), 0.0])
            ahead = np.cross(side, along)
            ahead *= scale / np.linalg.norm(ahead)
            node.set_mat(
                LMatrix4f(*ahead, 0.0, *(-scale * -side), 0.0, *along, 0.0, *joints[start], 1.0)
            )


def _coloured(mesh: Mesh, colour: tuple[float, float, float]) -> Mesh:
    return mesh.painted(colour)


def _limb(start: float, end: float, hand: tuple[float, float, float] | None = None) -> Mesh:
    """A tapered limb of length 1 along z, with a rounded end."""
    del hand
    return tube([start * 0.6, start, end, end * 0.6], [-0.06, 0.04, 0.94, 1.03], sides=7)


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
    keep = cap.points[cap.triangles].mean(axis=1)
    behind = (keep[:, 2] > 0.035) | ((keep[:, 0] < -0.02) & (keep[:, 2] > -0.055))
    cap = Mesh(cap.points, cap.uv, cap.normals, cap.colours, cap.triangles[behind])
    cap = cap.moved((0, 0, 0), scale=(1.0, 0.84, 1.2 * stretch)).painted(hair)
    return merged([neck, face, cap.moved((-0.004, 0, 1.04))])
