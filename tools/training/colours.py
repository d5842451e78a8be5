"""Colours of vests, clothes and things made by people."""

from __future__ import annotations

import colorsys

import numpy as np

__all__ = ["Colour", "any_colour", "cloth", "hi_vis"]

Colour = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""

_HUES = (
    (55.0, 112.0, 0.48),
    (112.0, 150.0, 0.2),
    (14.0, 32.0, 0.2),
    (-8.0, 6.0, 0.07),
    (325.0, 345.0, 0.05),
)
"""Hues of hazard vests in degrees and their shares: lime to yellow, lime as a camera gives it
whose white balance is off, orange, red, pink."""

_PALEST = 0.22
"""Saturation of a vest that the sun blows out."""

_GARISH, _BRIGHT, _RED = 0.22, 0.22, 0.16
"""Shares of clothes that have a vest's colour, another strong one, or a red or orange one that is
no vest's: what has been taken for vests in photographs was red more often than anything else."""


def hi_vis(rng: np.random.Generator) -> Colour:
    """Colour of a hazard vest."""
    low, high, _ = _HUES[rng.choice(len(_HUES), p=[share for *_, share in _HUES])]
    hue = rng.uniform(low, high) % 360.0 / 360.0
    return colorsys.hsv_to_rgb(hue, rng.uniform(_PALEST, 1.0), rng.uniform(0.72, 1.0))


def any_colour(rng: np.random.Generator) -> Colour:
    """Colour of a thing made by people: greys and dull tones more often than bright ones."""
    return colorsys.hsv_to_rgb(rng.uniform(), rng.beta(1.0, 2.2), rng.uniform(0.04, 1.0))


def cloth(rng: np.random.Generator) -> Colour:
    """Colour of a shirt, jacket or dress."""
    kind = rng.random()
    if kind < _GARISH:
        return hi_vis(rng)
    if kind < _GARISH + _BRIGHT:
        return colorsys.hsv_to_rgb(rng.uniform(), rng.uniform(0.6, 1.0), rng.uniform(0.25, 1.0))
    if kind < _GARISH + _BRIGHT + _RED:
        hue = rng.uniform(-0.05, 0.09) % 1.0
        return colorsys.hsv_to_rgb(hue, rng.uniform(0.5, 1.0), rng.uniform(0.3, 1.0))
    return any_colour(rng)
