# ruff: noqa: PLR2004 - the proportions of a drawing
"""Procedural textures, with sides that are powers of two as the software renderer requires."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from panda3d.core import SamplerState, Texture

__all__ = ["Palette", "VestCut", "noise", "texture_of", "vest_texture"]

Floats = NDArray[np.float64]

_SIZE = 256
"""Pixels along a side of most textures."""


def noise(size: int, roughness: float, seed: int, stretch: float = 1.0) -> Floats:
    """Noise (size, size) that repeats seamlessly, with mean 0 and standard deviation 1.

    Args:
        size: Pixels along each side.
        roughness: Power of spatial frequency with which its amplitude falls: 0 is white, 1 is
            cloudy, 2 is smooth.
        seed: Seed of the noise.
        stretch: More than 1 elongates it along the rows' direction.
    """
    white = np.fft.rfft2(np.random.default_rng(seed).standard_normal((size, size)))
    fy = np.fft.fftfreq(size)[:, None]
    fx = np.fft.rfftfreq(size)[None, :] * stretch
    frequency = np.hypot(fx, fy)
    frequency[0, 0] = np.inf
    field = np.fft.irfft2(white * frequency**-roughness, s=(size, size))
    return np.asarray(field / field.std())


def _blend(low: ArrayLike, high: ArrayLike, share: Floats) -> Floats:
    share = np.clip(share, 0.0, 1.0)[..., None]
    return np.asarray(low) * (1.0 - share) + np.asarray(high) * share


def texture_of(name: str, colours: Floats, alpha: Floats | None = None) -> Texture:
    """Texture of colours and alpha; row 0 is the bottom.

    Args:
        name: Name of the texture.
        colours: RGB, 0 to 1, (h, w, 3).
        alpha: 0 to 1, (h, w); None for an opaque texture.
    """
    height, width = colours.shape[:2]
    channels = [colours[..., ::-1]] if alpha is None else [colours[..., ::-1], alpha[..., None]]
    pixels = np.clip(np.concatenate(channels, axis=-1) * 255.0, 0, 255).astype(np.uint8)
    texture = Texture(name)
    kind = Texture.F_rgb if alpha is None else Texture.F_rgba
    texture.setup_2d_texture(width, height, Texture.T_unsigned_byte, kind)
    texture.set_ram_image(pixels.tobytes())
    texture.set_minfilter(SamplerState.FT_linear_mipmap_linear)
    texture.set_magfilter(SamplerState.FT_linear)
    texture.set_wrap_u(SamplerState.WM_repeat)
    texture.set_wrap_v(SamplerState.WM_repeat)
    return texture


@dataclass(frozen=True)
class VestCut:
    """Design of a hazard vest."""

    colour: tuple[float, float, float]
    silver: tuple[float, float, float] = (0.86, 0.87, 0.88)
    """Colour of the reflective bands."""
    bands: tuple[float, ...] = (0.16, 0.40)
    """Positions of the horizontal bands, from the hem (0) to the neck (1)."""
    band: float = 0.055
    """Half the width of a horizontal band, in the same unit."""
    straps: bool = True
    """Whether bands run over the shoulders, down to `straps_from`."""
    straps_from: float = 0.40
    strap: float = 0.03
    """Half the width of a band over the shoulder, as a fraction of the circumference."""
    open_sides: float = 0.0
    """Half the width of the gap below the arms that shows the shirt, in the same unit."""
    hem: float = 0.04
    """Overhang of the vest below the pelvis, as a fraction of the torso."""
    flare: float = 0.0
    """Distance of the hem from the body, metres."""
    open_front: float = 0.0
    """Half the width of the gap that shows the shirt where it is not closed, as `strap`."""
    edging: tuple[float, float, float] | None = None
    """Colour of a stripe above and below each horizontal band, if there is one."""


def vest_texture(cut: VestCut, shirt: ArrayLike) -> Texture:
    """A hazard vest around a torso over a shirt: silver bands, a zip, gaps at the sides.

    Args:
        cut: Colours, bands and gaps of the vest.
        shirt: Colour of the shirt, RGB, 0 to 1.
    """
    size = 64
    u, v = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size)
    cloth = np.asarray(cut.colour) * (1.0 + 0.05 * noise(size, 1.0, 7))[..., None]
    around = np.zeros_like(u, dtype=bool)
    if cut.edging is not None:
        for level in cut.bands:
            cloth[np.abs(v - level) < 1.6 * cut.band] = np.asarray(cut.edging)
    for level in cut.bands:
        around |= np.abs(v - level) < cut.band
    # u runs once around from the back: 0.25 is the right side, 0.5 the chest, 0.75 the left.
    over = np.zeros_like(u, dtype=bool)
    for place in (0.10, 0.40, 0.60, 0.90) if cut.straps else ():
        over |= (np.abs(u - place) < cut.strap) & (v > cut.straps_from)
    cloth[around | over] = np.asarray(cut.silver)
    cloth[(np.abs(u - 0.5) < 0.012) & ~around] *= 0.55
    gap = (np.abs(np.abs(u - 0.5) - 0.25) < cut.open_sides) & (v < 0.9) & ~around
    cloth[gap | (np.abs(u - 0.5) < cut.open_front)] = np.asarray(shirt)
    return texture_of("vest", cloth)


class Palette:
    """Textures of one world, each drawn on first use."""

    def __init__(self) -> None:
        """Start without textures."""
        self._made: dict[str, Texture] = {}

    def __getitem__(self, name: str) -> Texture:
        """Texture called `name`: a method of this class, without its underscore."""
        if name not in self._made:
            self._made[name] = getattr(self, f"_{name}")()
        return self._made[name]

    def _grass(self) -> Texture:
        size = 2 * _SIZE
        blades = noise(size, 0.45, 1, 0.6)
        patches = noise(size, 1.4, 2)
        dry = np.clip(0.4 + 0.13 * patches + 0.18 * blades, 0, 1)
        colours = _blend((0.33, 0.44, 0.17), (0.60, 0.60, 0.34), dry)
        return texture_of("grass", colours * (1.0 + 0.17 * blades)[..., None])

    def _soil(self) -> Texture:
        crumbs, patches = noise(_SIZE, 0.6, 3), noise(_SIZE, 1.3, 4)
        colours = _blend((0.33, 0.24, 0.16), (0.52, 0.41, 0.29), 0.5 + 0.25 * patches)
        return texture_of("soil", colours * (1.0 + 0.13 * crumbs)[..., None])

    def _asphalt(self) -> Texture:
        grain, stains = noise(_SIZE, 0.2, 5), noise(_SIZE, 1.5, 6)
        grey = 0.40 + 0.035 * grain + 0.03 * stains
        return texture_of("asphalt", np.stack([grey, grey, 1.03 * grey], axis=-1))

    def _gravel(self) -> Texture:
        grain, patches = noise(_SIZE, 0.35, 8), noise(_SIZE, 1.3, 9)
        colours = _blend((0.55, 0.50, 0.42), (0.70, 0.66, 0.58), 0.5 + 0.2 * patches)
        return texture_of("gravel", colours * (1.0 + 0.11 * grain)[..., None])

    def _bark(self) -> Texture:
        furrows = noise(_SIZE // 4, 0.9, 10, 5.0).T
        return texture_of("bark", np.array([0.38, 0.30, 0.23]) * (1.0 + 0.22 * furrows)[..., None])

    def _leaves(self) -> Texture:
        size = _SIZE // 2
        leaf, clumps = noise(size, 0.7, 11), noise(size, 1.3, 12)
        light = 0.45 + 0.20 * leaf + 0.15 * clumps
        colours = _blend((0.13, 0.22, 0.08), (0.50, 0.60, 0.26), light)
        return texture_of("leaves", colours, (leaf + 0.4 * clumps > -0.55).astype(np.float64))

    def _crop(self) -> Texture:
        """Row of young plants: blades that fan out from stems, on a transparent background."""
        width, height, rng = 256, 64, np.random.default_rng(13)
        colours, alpha = np.zeros((height, width, 3)), np.zeros((height, width))
        colours[:] = (0.25, 0.42, 0.12)
        rows = np.arange(height)
        for stem in range(0, width, 16):
            for _ in range(9):
                lean, tall = rng.normal(0.0, 15.0), rng.uniform(0.55, 1.0) * height
                green = rng.uniform(0.75, 1.25) * np.array([0.38, 0.58, 0.20])
                share = rows[rows < tall] / tall
                middle = stem + 8 + rng.normal(0, 2) + lean * share**1.6
                half = 2.6 * (1.0 - share) ** 0.6 + 0.4
                for row, place, reach in zip(rows, middle, half, strict=False):
                    columns = np.arange(int(place - reach), int(place + reach) + 1) % width
                    colours[row, columns] = green * (0.6 + 0.4 * row / height)
                    alpha[row, columns] = 1.0
        return texture_of("crop", colours, alpha)

    def _brick(self) -> Texture:
        size, rows, columns = _SIZE, 16, 8
        y, x = np.mgrid[0:size, 0:size]
        row = y * rows // size
        across = x * columns / size + 0.5 * (row % 2)
        tone = np.random.default_rng(14).uniform(0.8, 1.15, (rows, columns))
        colours = np.array([0.62, 0.30, 0.22]) * tone[row, across.astype(int) % columns][..., None]
        joint = ((y * rows / size) % 1 < 0.13) | (across % 1 < 0.06)
        colours[joint] = (0.68, 0.65, 0.60)
        return texture_of("brick", colours * (1.0 + 0.05 * noise(size, 0.5, 15))[..., None])

    def _plaster(self) -> Texture:
        grey = 0.93 + 0.02 * noise(_SIZE, 0.5, 16) + 0.02 * noise(_SIZE, 1.5, 17)
        return texture_of("plaster", np.repeat(grey[..., None], 3, axis=-1))

    def _wood(self) -> Texture:
        size, planks = _SIZE, 8
        x = np.arange(size)
        tone = np.random.default_rng(18).uniform(0.82, 1.1, planks)[x * planks // size]
        tone = np.where((x * planks / size) % 1 < 0.06, 0.45, tone)
        grain = 1.0 + 0.07 * noise(size, 0.8, 19, 6.0)
        return texture_of("wood", np.array([0.55, 0.42, 0.30]) * (tone * grain)[..., None])

    def _tiles(self) -> Texture:
        size, rows, columns = _SIZE, 16, 16
        y, x = np.mgrid[0:size, 0:size]
        row = y * rows // size
        across = x * columns / size + 0.5 * (row % 2)
        tone = np.random.default_rng(20).uniform(0.85, 1.1, (rows, columns))
        shade = tone[row, across.astype(int) % columns] * (0.7 + 0.3 * ((y * rows / size) % 1))
        return texture_of("tiles", np.array([0.60, 0.33, 0.26]) * shade[..., None])

    def _shadow(self) -> Texture:
        """Dark disc with a soft edge."""
        axis = np.linspace(-1, 1, 64)
        alpha = np.clip(1.6 * (1.0 - np.hypot(*np.meshgrid(axis, axis))), 0.0, 0.5)
        return texture_of("shadow", np.zeros((64, 64, 3)), alpha)

    def _facade(self) -> Texture:
        """One repeatable bay of a plaster wall with a window."""
        size = 128
        colours = np.full((size, size, 3), 0.93) * (1.0 + 0.02 * noise(size, 1.0, 21))[..., None]
        y, x = np.mgrid[0:size, 0:size] / size
        frame = (np.abs(x - 0.5) < 0.24) & (np.abs(y - 0.55) < 0.27)
        pane = (np.abs(x - 0.5) < 0.215) & (np.abs(y - 0.55) < 0.245)
        colours[frame] = 0.98
        glass = _blend((0.20, 0.27, 0.34), (0.52, 0.63, 0.72), 0.3 + 0.8 * (y - 0.3))
        colours[pane] = glass[pane]
        colours[(np.abs(x - 0.5) < 0.012) & frame] = 0.96
        return texture_of("facade", colours)

    def _plain(self) -> Texture:
        return texture_of("plain", np.ones((4, 4, 3)))
