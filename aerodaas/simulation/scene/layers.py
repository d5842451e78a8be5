"""Nodes with the state that the painter's order needs.

Everything flat on the ground (the ground itself, fields, roads, shadows) is painted first and in
this order without a depth test, because nothing lies below it; so flat things never flicker
through each other, however far away.
"""

from __future__ import annotations

import enum

from panda3d.core import NodePath, Texture, TransparencyAttrib

from aerodaas.simulation.scene.mesh import Mesh

__all__ = ["LABEL", "Layer", "attach"]

LABEL = "label"
"""Tag of the nodes that detectors look for: the thing's id, a slash, the kind."""


class Layer(enum.IntEnum):
    """What is painted over what."""

    SKY = 0
    GROUND = 1
    FIELD = 2
    ROAD = 3
    SHADOW = 4
    SOLID = 5
    """Everything that stands on the ground, sorted by depth."""


def attach(
    parent: NodePath,
    name: str,
    mesh: Mesh,
    texture: Texture,
    *,
    layer: Layer = Layer.SOLID,
    cutout: bool = False,
    both_sides: bool = False,
) -> NodePath:
    """Attach `mesh` with `texture` below `parent`; `cutout` honours the texture's holes."""
    node = parent.attach_new_node(mesh.node(name))
    node.set_texture(texture)
    node.set_two_sided(both_sides)
    if layer is Layer.SOLID:
        # panda3d would sort by the addresses of states, and where surfaces touch the picture
        # would then differ from run to run; unsorted, it draws in the order of the scene.
        node.set_bin("unsorted", 0)
    else:
        node.set_bin("background", int(layer))
        node.set_depth_test(False)
        node.set_depth_write(False)
    if layer is Layer.SHADOW:
        node.set_transparency(TransparencyAttrib.M_alpha)
    elif cutout:
        node.set_transparency(TransparencyAttrib.M_binary)
    return node
