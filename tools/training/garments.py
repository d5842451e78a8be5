# ruff: noqa: PLR2004, SIM300 - the proportions of drawings, along _U and _V
"""Clothes that are no hazard vest, however like one: stripes, straps, jackets, dresses, bags."""

from __future__ import annotations

import colorsys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from aerodaas.simulation.scene.people import Garment
from aerodaas.simulation.scene.textures import noise, texture_of
from tools.training.colours import Colour, any_colour, cloth

__all__ = ["draw_garment"]

Floats = NDArray[np.float64]
Generator = np.random.Generator

_SIZE = 64
"""Pixels along a side: a torso is seldom larger in a picture."""

_U, _V = np.meshgrid((np.arange(_SIZE) + 0.5) / _SIZE, (np.arange(_SIZE) + 0.5) / _SIZE)
"""Once around from the back (0) over the chest (0.5); from the hem (0) to the neck (1)."""

_LONG = 0.3
"""Share of coats, dresses and long shirts."""


def draw_garment(colour: Colour, rng: Generator) -> Garment:
    """A garment of a base `colour`, with a print, and as often as not with straps over it."""
    painted = np.tile(np.asarray(colour, np.float64), (_SIZE, _SIZE, 1))
    _PRINTS[rng.integers(len(_PRINTS))](painted, rng)
    if rng.random() < 0.3:
        _straps(painted, rng)
    folds = noise(_SIZE, rng.uniform(0.6, 1.8), int(rng.integers(1 << 30)))
    painted *= 1.0 + rng.uniform(0.0, 0.12) * folds[..., None]
    hem, flare = rng.uniform(0.0, 0.15), rng.uniform(0.0, 0.02)
    if rng.random() < _LONG:
        hem, flare = rng.uniform(0.25, 1.4), rng.uniform(0.0, 0.14)
    return Garment(texture_of("garment", np.clip(painted, 0, 1)), hem, flare)


def _other(rng: Generator) -> Colour:
    """Colour of a print: white and black more often than any one else."""
    kind = rng.random()
    if kind < 0.3:
        return colorsys.hsv_to_rgb(0.0, 0.0, rng.uniform(0.75, 1.0))
    if kind < 0.45:
        return colorsys.hsv_to_rgb(0.0, 0.0, rng.uniform(0.0, 0.2))
    return cloth(rng)


def _plain(painted: Floats, rng: Generator) -> None:
    """A zip or a row of buttons at most."""
    if rng.integers(2):
        painted[np.abs(_U - 0.5) < 0.012] *= rng.uniform(0.4, 1.0)


def _stripes(painted: Floats, rng: Generator) -> None:
    along = _V if rng.random() < 0.7 else _U
    count, share = rng.integers(2, 14), rng.uniform(0.15, 0.6)
    painted[(along * count + rng.random()) % 1.0 < share] = _other(rng)


def _checks(painted: Floats, rng: Generator) -> None:
    count, share = rng.integers(4, 14), rng.uniform(0.2, 0.6)
    second = np.asarray(_other(rng))
    for along in (_U * 2, _V):
        where = (along * count) % 1.0 < share
        painted[where] = (painted[where] + second) / 2


def _flowers(painted: Floats, rng: Generator) -> None:
    """Spots of a few colours, as of flowers or dots."""
    colours = [_other(rng) for _ in range(rng.integers(1, 4))]
    for _ in range(rng.integers(12, 90)):
        u, v, radius = rng.random(), rng.random(), rng.uniform(0.01, 0.07)
        spot = np.hypot(2.0 * (_U - u), _V - v) < radius
        painted[spot] = colours[rng.integers(len(colours))]


def _patches(painted: Floats, rng: Generator) -> None:
    """Camouflage, batik."""
    field = noise(_SIZE, rng.uniform(1.0, 2.0), int(rng.integers(1 << 30)))
    painted[field > rng.uniform(-0.5, 1.0)] = _other(rng)
    painted[field < rng.uniform(-2.0, -0.6)] = _other(rng)


def _jacket(painted: Floats, rng: Generator) -> None:
    """Open above a shirt, in front, perhaps with a tie."""
    wide = rng.uniform(0.02, 0.12)
    front = np.abs(_U - 0.5) < wide * np.clip((_V - rng.uniform(-0.6, 0.4)) * 1.6, 0, 1)
    painted[front] = _other(rng)
    if rng.random() < 0.4:
        painted[front & (np.abs(_U - 0.5) < 0.018)] = cloth(rng)


def _logo(painted: Floats, rng: Generator) -> None:
    """A print or a number on the chest or back."""
    u, v = rng.choice([0.5, 0.42, 0.02]), rng.uniform(0.4, 0.8)
    size = rng.uniform((0.02, 0.03), (0.11, 0.2))
    inside = (np.abs(_U - u) < size[0]) & (np.abs(_V - v) < size[1])
    painted[inside] = _other(rng)
    painted[inside & (rng.random((_SIZE, _SIZE)) < rng.uniform(0, 0.5))] = any_colour(rng)


def _blocks(painted: Floats, rng: Generator) -> None:
    """Yoke, sides or a broad band of another colour."""
    level = rng.uniform(0.15, 0.8)
    where = (
        _V > level,
        np.abs(_V - level) < rng.uniform(0.03, 0.15),
        np.abs(np.abs(_U - 0.5) - 0.25) < rng.uniform(0.03, 0.12),
        _U > 0.5,
    )
    painted[where[rng.integers(len(where))]] = _other(rng)


def _straps(painted: Floats, rng: Generator) -> None:
    """Of a rucksack, of a bag worn across, or braces."""
    colour, half = _other(rng), rng.uniform(0.012, 0.035)
    if rng.random() < 0.35:
        across = 0.5 + (_V - 0.5) * rng.uniform(0.15, 0.4) * rng.choice([-1.0, 1.0])
        painted[np.abs(_U - across) < half] = colour
        return
    place = rng.uniform(0.07, 0.13)
    low = rng.uniform(-0.2, 0.6)
    painted[(np.abs(np.abs(_U - 0.5) - place) < half) & (_V > low)] = colour
    if rng.random() < 0.6:
        painted[(np.abs(_U - 0.5) > 0.36) & (np.abs(_V - 0.55) < 0.35)] = _other(rng)


_PRINTS: tuple[Callable[[Floats, Generator], None], ...] = (
    _plain,
    _stripes,
    _checks,
    _flowers,
    _patches,
    _jacket,
    _logo,
    _blocks,
)
