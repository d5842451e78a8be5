"""Rendering layers, and nodes with the render state for the order of painting.

Flat objects (the ground itself, fields, roads, shadows) are painted first and in this order
without a depth test, because nothing lies below them; so they never flicker through each other
at any distance.
"""

from __future__ import annotations

import enum

from panda3d.core import NodePath, Texture, TransparencyAttrib

from aerodaas.simulation.scene.mesh import Mesh

__all__ = ["LABEL", "Layer", "attach"]

LABEL = "label"
"""Tag of the nodes of detectable objects: the object's id, a slash, the kind."""


class Layer(enum.IntEnum):
    """Layers in the order of painting."""

    SKY = 0
    GROUND = 1
    FIELD = 2
    ROAD = 3
    SHADOW = 4
    SOLID = 5
    """Objects standing on the ground, sorted by depth."""


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
    """Attach `mesh` with `texture` to `parent`.

    Args:
        parent: Node of the scene to which it is attached.
        name: Name of the new node.
        mesh: The form.
        texture: Its texture.
        layer: Layer in which it is drawn.
        cutout: Whether the texture's transparency applies.
        both_sides: Whether its back is drawn as well.

    Returns:
        The new node.
    """
    node = parent.attach_new_node(mesh.node(name))
    node.set_texture(texture)
    node.set_two_sided(both_sides)
    if layer is Layer.SOLID:
        # panda3d would sort by the addresses of states, so that images would differ from run to
        # run where surfaces touch; unsorted, it draws in the order of the scene.
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
