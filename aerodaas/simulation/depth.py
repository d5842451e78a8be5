"""Depth images of a simulated world, aligned with the camera's images.

The software renderer provides no depth buffer. So the scene is rendered once more with a texture
of two rulers along the optical axis, so that the colour of a pixel encodes its depth.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from panda3d.core import (
    Camera,
    ColorAttrib,
    ColorScaleAttrib,
    LightAttrib,
    LMatrix4f,
    NodePath,
    RenderState,
    SamplerState,
    TexGenAttrib,
    TexMatrixAttrib,
    Texture,
    TextureAttrib,
    TextureStage,
    TransformState,
    TransparencyAttrib,
)

from aerodaas.geometry.depth import METRE
from aerodaas.geometry.frames import CameraModel
from aerodaas.simulation.renderer import Renderer
from aerodaas.simulation.world import World

__all__ = ["DepthRenderer", "renderer_for"]

_MARKS = 1024
"""Number of marks on each ruler: for 10 m, one per centimetre."""
_SPARE = 1.05
"""Ratio of the fine ruler's length to the range."""
_WORLD = 1310.72
"""Length of the coarse ruler in metres, which counts the repetitions of the fine one."""
_PAINTED = 8
"""Bit set in every colour on the rulers; a pixel without it shows no object."""
_OVERRIDE = 100
"""Priority over the states of nodes."""


def renderer_for(world: World, camera: CameraModel, depth_range: float | None) -> Renderer:
    """Create the renderer for `camera`, with depth if a range in metres is given."""
    if depth_range is None:
        return Renderer(world, camera)
    return DepthRenderer(world, camera, depth_range)


class DepthRenderer(Renderer):
    """Renders the image and the depth of each of its pixels.

    The depth is accurate to about 2 %, limited by the renderer's rounding; holes in leaves count
    as leaves. The error of a real stereo camera grows with the square of the distance, and its
    depth has holes.
    """

    def __init__(self, world: World, camera: CameraModel, depth_range: float) -> None:
        """Measure depth up to `depth_range` metres along the optical axis."""
        super().__init__(world, camera)
        self._range = depth_range
        self._length = _SPARE * depth_range
        eye = Camera("depth", self._eye.node().get_lens())
        eye.set_initial_state(_rulers(self._length))
        self._marks = self._open(self._eye.attach_new_node(eye), np.zeros(3))

    def depth(self) -> NDArray[np.uint16]:
        """Depth of the last image, (height, width) in millimetres, 0 beyond the range."""
        shape = (self._camera.height, self._camera.width, 4)
        marks = cv2.flip(np.frombuffer(self._marks.get_ram_image(), np.uint8).reshape(shape), 0)
        rest, fine, coarse = (marks[..., channel].astype(np.int32) for channel in range(3))
        about = (coarse * 4 + (rest >> 6) + 0.5) * (_WORLD / _MARKS)
        metres = (fine * 4 + (rest >> 4 & 3) + 0.5) * (self._length / _MARKS)
        metres += np.round((about - metres) / self._length) * self._length
        measured = (rest & _PAINTED > 0) & (metres <= self._range)
        return np.where(measured, metres * METRE, 0).astype(np.uint16)


def _rulers(length: float) -> RenderState:
    """Render state that colours every surface by its depth alone."""
    fine, coarse = np.mgrid[:_MARKS, :_MARKS]
    rest = (coarse % 4 << 6) + (fine % 4 << 4) + _PAINTED
    rulers = Texture("rulers")
    rulers.setup_2d_texture(_MARKS, _MARKS, Texture.T_unsigned_byte, Texture.F_rgb)
    colours = np.stack([rest, fine // 4, coarse // 4], axis=-1)
    rulers.set_ram_image(colours.astype(np.uint8).tobytes())
    rulers.set_magfilter(SamplerState.FT_nearest)
    rulers.set_minfilter(SamplerState.FT_nearest)
    stage = TextureStage.get_default()
    along = LMatrix4f(0, 0, 0, 0, 1 / _WORLD, 1 / length, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1)
    node = NodePath("rulers")
    node.set_texture(rulers)
    node.set_tex_gen(stage, TexGenAttrib.M_eye_position)
    node.set_tex_transform(stage, TransformState.make_mat(along))
    state = node.get_state()
    parts = [state.get_attrib(kind) for kind in (TextureAttrib, TexGenAttrib, TexMatrixAttrib)]
    parts += [
        LightAttrib.make_all_off(),
        ColorAttrib.make_flat((1, 1, 1, 1)),
        ColorScaleAttrib.make_off(),
        TransparencyAttrib.make(TransparencyAttrib.M_none),
    ]
    for part in parts:
        state = state.set_attrib(part, _OVERRIDE)
    return state
