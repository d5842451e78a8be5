"""Sun, clouds and sky dome of a world."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from panda3d.core import NodePath, SamplerState, Texture

from aerodaas.simulation.scenario import Sky
from aerodaas.simulation.scene.layers import Layer, attach
from aerodaas.simulation.scene.mesh import Mesh, blob
from aerodaas.simulation.scene.textures import noise

__all__ = ["HAZE", "Light", "sky_dome"]

HAZE = np.array([0.78, 0.84, 0.88])
"""Colour of the horizon."""

_ZENITH = np.array([0.27, 0.47, 0.75])
_OVERCAST = np.array([0.74, 0.77, 0.80])
_CLOUD_HEIGHT = 0.14
"""Perspective of the clouds; with smaller values they shrink more towards the horizon."""

_DOME = 400.0
"""Radius in metres; the sky is painted first, so it occludes no object."""

_ROWS, _COLUMNS = 256, 1024


@dataclass(frozen=True)
class Light:
    """Position of the sun, and cloud cover."""

    azimuth: float
    """Radians counter-clockwise from east."""
    elevation: float
    """Radians."""
    clouds: float
    """Cloud cover, 0 to 1."""
    seed: int

    @classmethod
    def draw(cls, sky: Sky, seed: int) -> Light:
        """Draw the values that the scenario leaves open from the seed.

        Args:
            sky: Values of the scenario, some left open.
            seed: Seed of the world.
        """
        random_ = random.Random(f"{seed}/sky")
        azimuth, elevation = random_.uniform(0, 360), random_.uniform(30, 65)
        clouds = random_.uniform(0.15, 0.6)
        return cls(
            math.radians(azimuth if sky.sun_azimuth is None else sky.sun_azimuth),
            math.radians(elevation if sky.sun_elevation is None else sky.sun_elevation),
            clouds if sky.clouds is None else sky.clouds,
            random_.randrange(2**31),
        )

    @property
    def sun(self) -> NDArray[np.float64]:
        """Unit vector towards the sun, ENU."""
        level = math.cos(self.elevation)
        return np.array(
            [
                level * math.cos(self.azimuth),
                level * math.sin(self.azimuth),
                math.sin(self.elevation),
            ]
        )

    def shadow_offset(self, height: float) -> tuple[float, float]:
        """Offset (east, north) in metres of the shadow of a point at `height` metres."""
        reach = height / math.tan(self.elevation)
        return -reach * math.cos(self.azimuth), -reach * math.sin(self.azimuth)


def sky_dome(parent: NodePath, light: Light) -> NodePath:
    """Attach the sky dome, which the renderer keeps centred on the camera.

    Args:
        parent: Node of the scene to which it is attached.
        light: Sun and sky of the scene.

    Returns:
        The dome's node.
    """
    dome = blob(_DOME, rings=19, sides=24, repeat=1.0)
    up = np.clip(dome.points[:, 2] / _DOME, -1.0, 1.0)
    uv = np.stack([dome.uv[:, 0], np.clip(2.0 * np.arcsin(up) / np.pi, 0.004, 0.996)], axis=-1)
    above = dome.triangles[up[dome.triangles].max(axis=1) > 0.0]
    inward = Mesh(dome.points, uv, dome.normals, dome.colours, above[:, ::-1])
    node = attach(parent, "sky", inward, _panorama(light), layer=Layer.SKY)
    node.node().set_final(True)
    return node


def _panorama(light: Light) -> Texture:
    azimuth = (np.arange(_COLUMNS) + 0.5) / _COLUMNS * 2 * np.pi - np.pi
    elevation = ((np.arange(_ROWS) + 0.5) / _ROWS * np.pi / 2)[:, None]
    clear = HAZE + (_ZENITH - HAZE) * (1.0 - np.exp(-3.2 * np.sin(elevation)))[..., None]
    colours = np.broadcast_to(clear, (_ROWS, _COLUMNS, 3)).copy()
    cover, shade = _clouds(light, azimuth, elevation)
    colours += cover[..., None] * (shade[..., None] * np.array([1.0, 1.0, 1.01]) - colours)
    toward = np.cos(elevation) * np.cos(light.elevation) * np.cos(azimuth - light.azimuth)
    toward = toward + np.sin(elevation) * np.sin(light.elevation)
    glow = 0.35 * np.clip(toward, 0, 1) ** 24 + np.clip((toward - 0.9985) * 900, 0, 1)
    colours += glow[..., None] * np.array([1.0, 0.97, 0.88])
    texture = Texture("sky")
    texture.setup_2d_texture(_COLUMNS, _ROWS, Texture.T_unsigned_byte, Texture.F_rgb)
    pixels = np.clip(colours[..., ::-1] * 255.0, 0, 255).astype(np.uint8)
    texture.set_ram_image(pixels.tobytes())
    texture.set_minfilter(SamplerState.FT_linear)
    texture.set_magfilter(SamplerState.FT_linear)
    texture.set_wrap_u(SamplerState.WM_repeat)
    texture.set_wrap_v(SamplerState.WM_clamp)
    return texture


def _clouds(
    light: Light, azimuth: NDArray[np.float64], elevation: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Opacity and brightness of a flat cloud layer seen from below."""
    size = 512
    field = noise(size, 1.45, light.seed % 2**31)
    away = 0.13 / (np.sin(elevation) + _CLOUD_HEIGHT)
    x = away * np.cos(azimuth) * size % size
    y = away * np.sin(azimuth) * size % size
    tiled = np.pad(field, ((0, 1), (0, 1)), mode="wrap").astype(np.float32)
    seen = cv2.remap(
        tiled, x.astype(np.float32), y.astype(np.float32), interpolation=cv2.INTER_LINEAR
    )
    threshold = float(np.quantile(field, 1.0 - min(max(light.clouds, 0.01), 0.99)))
    depth = np.clip((seen - threshold) / 0.9, 0.0, 1.0)
    cover = depth**0.8 * np.clip(elevation / 0.12, 0.0, 1.0) * 0.92
    shade = 0.99 - (1.0 - _OVERCAST.mean()) * np.clip((seen - threshold) / 2.2, 0.0, 1.0)
    return cover, shade
