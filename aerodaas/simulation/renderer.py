"""Images of a simulated world with their depth, by panda3d's software renderer.

It needs no GPU, display or system library. panda3d's axes agree with ENU (x right/east, y
ahead/north, z up), and its cameras look along their own y axis. The software renderer provides
no depth buffer. So the scene is rendered once more with a texture of two rulers along the optical
axis, so that the colour of a pixel encodes its depth.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from panda3d.core import (
    Camera,
    ColorAttrib,
    ColorScaleAttrib,
    FrameBufferProperties,
    GraphicsEngine,
    GraphicsOutput,
    GraphicsPipe,
    GraphicsPipeSelection,
    LightAttrib,
    LMatrix4f,
    NodePath,
    PerspectiveLens,
    RenderState,
    SamplerState,
    TexGenAttrib,
    TexMatrixAttrib,
    Texture,
    TextureAttrib,
    TextureStage,
    TransformState,
    TransparencyAttrib,
    WindowProperties,
    load_prc_file_data,
)

from aerodaas.errors import SourceError
from aerodaas.geometry.depth import METRE
from aerodaas.geometry.frames import CameraModel, rotation_from_rpy
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.scene.light import HAZE
from aerodaas.simulation.scene.scene import ObjectAppearance, Scene
from aerodaas.simulation.world import World

__all__ = ["DepthRenderer", "Renderer", "renderer_for"]

# A moving camera permanently adds some 36 entries per frame to panda3d's transform cache.
_SETTINGS = """
transform-cache false
load-display p3tinydisplay
window-type offscreen
audio-library-name null
notify-level warning
"""

_NEAR, _FAR = 0.1, 1200.0
"""Metres."""

_LOWEST = 0.12
"""Least height of the camera above the ground in metres, by the landing gear."""


class Renderer:
    """Renders one camera's view of a world; usable only in the thread that created it.

    Raises SourceError if the software renderer is not available.
    """

    def __init__(
        self, world: World, camera: CameraModel, appearance: ObjectAppearance | None = None
    ) -> None:
        """Build the scene and an offscreen buffer of the camera's size."""
        load_prc_file_data("aerodaas", _SETTINGS)
        # OpenCV has two small things to do for a picture. Its other threads, which wait for more by
        # spinning, take a tenth of what the whole picture takes.
        cv2.setNumThreads(1)
        self._camera = camera
        self._optical = camera.body_from_optical
        pipe = GraphicsPipeSelection.get_global_ptr().make_pipe(
            "TinyOffscreenGraphicsPipe", "p3tinydisplay"
        )
        if pipe is None:
            raise SourceError(
                "panda3d's software renderer (p3tinydisplay) does not load; it needs libX11, "
                "which a bare system lacks: apt-get install libx11-6"
            )
        # A separate engine, so that rendering one camera does not render all others of the process.
        self._pipe = pipe
        self._engine = GraphicsEngine(pipe)
        self._scene = Scene(world, appearance)
        self._eye = self._scene.root.attach_new_node(Camera("eye", _lens(camera)))
        self._pixels = self._open(self._eye, HAZE)

    def _open(self, eye: NodePath, clear: ArrayLike) -> Texture:
        """Open an offscreen buffer for the camera `eye`, and return its texture."""
        camera = self._camera
        properties = FrameBufferProperties()
        properties.set_rgb_color(True)
        properties.set_depth_bits(24)
        buffer = self._engine.make_output(
            self._pipe,
            "camera",
            0,
            properties,
            WindowProperties.size(camera.width, camera.height),
            GraphicsPipe.BF_refuse_window,
        )
        if buffer is None:
            raise SourceError(
                f"cannot render {camera.width} x {camera.height} pixels; ask for fewer"
            )
        buffer.set_clear_color((*np.asarray(clear, dtype=float).tolist(), 1.0))
        pixels = Texture("pixels")
        buffer.add_render_texture(pixels, GraphicsOutput.RTM_copy_ram)
        buffer.make_display_region().set_camera(eye)
        return pixels

    def orient(self, camera: CameraModel) -> None:
        """Turn the camera as `camera` is mounted, and zoom to its focal length."""
        if camera.fx != self._camera.fx:
            self._eye.node().get_lens().set_focal_length(camera.fx)
        self._camera, self._optical = camera, camera.body_from_optical

    def render(self, time: float, pose: Odometry) -> NDArray[np.uint8]:
        """Render a picture (height, width, 3) in BGR from a vehicle.

        Args:
            time: Mission time, seconds.
            pose: Of the vehicle, which carries the camera.
        """
        body = rotation_from_rpy(pose.roll, pose.pitch, pose.yaw)
        right, down, ahead = (body @ self._optical).T
        x, y, z = np.asarray(pose.position) + body @ np.array(self._camera.mount)
        z = max(z, _LOWEST)
        self._eye.set_mat(LMatrix4f(*right, 0, *ahead, 0, *(-down), 0, x, y, z, 1))
        self._scene.update(time, (float(x), float(y), float(z)))
        self._engine.render_frame()
        height, width = self._camera.height, self._camera.width
        rendered = np.frombuffer(self._pixels.get_ram_image(), np.uint8)
        picture = np.empty((height, width, 3), np.uint8)
        cv2.cvtColor(rendered.reshape(height, width, 4), cv2.COLOR_BGRA2BGR, dst=picture)
        cv2.flip(picture, 0, dst=picture)
        return picture

    def depth(self) -> NDArray[np.uint16] | None:
        """Depth of the last image; None, as this camera measures none."""
        return None

    def close(self) -> None:
        """Free the buffer and the scene."""
        self._engine.remove_all_windows()
        self._scene.root.remove_node()


def _lens(camera: CameraModel) -> PerspectiveLens:
    """Pinhole lens of these intrinsics, with the film size in horizontal pixels."""
    lens = PerspectiveLens()
    stretch = camera.fx / camera.fy
    lens.set_film_size(camera.width, camera.height * stretch)
    lens.set_focal_length(camera.fx)
    lens.set_film_offset(camera.width / 2 - camera.cx, (camera.cy - camera.height / 2) * stretch)
    lens.set_near_far(_NEAR, _FAR)
    return lens


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
    """Create the renderer for `camera`.

    Args:
        world: The world to render.
        camera: Size, lens and mount of the camera.
        depth_range: Range of depth, metres; None for a camera without depth.
    """
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
