"""Looks far more various than a simulation needs, so that a network learns what lasts."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

import numpy as np
from panda3d.core import Texture

from aerodaas.simulation.scenario import Person
from aerodaas.simulation.scene.buildings import TowerLook
from aerodaas.simulation.scene.cars import CarShape
from aerodaas.simulation.scene.people import Outfit
from aerodaas.simulation.scene.scene import ObjectAppearance
from aerodaas.simulation.scene.textures import Palette, VestCut
from aerodaas.simulation.world import Thing, World, rng_of
from tools.training.colours import any_colour, cloth, hi_vis
from tools.training.garments import draw_garment

__all__ = ["VariousLooks"]

_SKINS = ((0.97, 0.82, 0.72), (0.82, 0.62, 0.46), (0.58, 0.40, 0.28), (0.33, 0.23, 0.17))

_CABINS = (
    ((-1.75, 0.90), (-1.30, 1.40), (0.05, 1.43), (0.95, 0.90)),
    ((-2.05, 0.90), (-1.95, 1.42), (0.25, 1.45), (1.05, 0.90)),
    ((-2.05, 0.90), (-1.75, 1.38), (0.10, 1.43), (0.95, 0.90)),
    ((-2.08, 0.90), (-2.06, 1.60), (0.95, 1.58), (1.70, 0.82)),
    ((-0.90, 0.90), (-0.80, 1.42), (0.15, 1.45), (0.95, 0.90)),
)
"""Saloon, estate, hatchback, van, pick-up."""

_PRINTED, _SLEEVELESS = 0.6, 0.15
"""Shares of people without a vest whose shirt is no plain one, and who wear no sleeves."""

_OPEN, _EDGED = 0.25, 0.2
"""Shares of vests that are not closed, and whose bands have an edge of another colour."""


class _TintedPalette(Palette):
    """The usual textures in other colours and contrasts."""

    _plain_ones = Palette()

    def __init__(self, seed: int) -> None:
        """Choose the colours by `seed`."""
        super().__init__()
        self._rng = np.random.default_rng([seed, 2])

    def __getitem__(self, name: str) -> Texture:
        """Texture called `name`, tinted when first asked for."""
        if name in {"plain", "shadow"}:
            return self._plain_ones[name]
        if name not in self._made:
            texture = self._plain_ones[name].make_copy()
            pixels = np.frombuffer(texture.get_ram_image(), np.uint8)
            pixels = pixels.reshape(-1, texture.get_num_components()).astype(np.float32)
            colours = pixels[:, :3]
            mean = colours.mean(axis=0)
            grey = mean.mean() + (mean - mean.mean()) * self._rng.uniform(0.2, 1.3)
            tint = grey * self._rng.uniform(0.85, 1.15, 3) * self._rng.uniform(0.55, 1.45)
            pixels[:, :3] = tint + (colours - mean) * self._rng.uniform(0.6, 2.0)
            texture.set_ram_image(np.clip(pixels, 0, 255).astype(np.uint8).tobytes())
            self._made[name] = texture
        return self._made[name]


@dataclass(frozen=True)
class VariousLooks(ObjectAppearance):
    """Draws each thing's looks from its seed."""

    def palette(self, world: World) -> Palette:
        """Textures tinted by the world's seed."""
        return _TintedPalette(world.seed)

    def outfit(self, thing: Thing) -> Outfit:
        """Dress a person in any clothes, with any cut of vest if the scenario gives one."""
        if not isinstance(thing.spec, Person):
            raise TypeError(f"{thing.id} is no person")
        rng = rng_of(thing)
        skin = np.array(_SKINS[rng.integers(len(_SKINS))]) * rng.uniform(0.85, 1.05)
        shirt = cloth(rng)
        blue = colorsys.hsv_to_rgb(rng.uniform(0.55, 0.65), rng.uniform(0.1, 0.7), rng.uniform())
        trousers = blue if rng.random() < 0.4 else any_colour(rng)  # noqa: PLR2004 - jeans
        worn = None if thing.spec.vest == "none" else _cut(rng)
        garment = draw_garment(shirt, rng) if rng.random() < _PRINTED else None
        return Outfit(
            skin=(float(skin[0]), float(skin[1]), float(skin[2])),
            hair=colorsys.hsv_to_rgb(0.08, rng.uniform(0, 0.6), rng.beta(1, 4)),
            shirt=shirt,
            trousers=trousers,
            shoes=any_colour(rng),
            bare_arms=bool(rng.integers(2)),
            bare_shoulders=worn is None and bool(rng.random() < _SLEEVELESS),
            garment=garment,
            vest=worn,
            build=rng.uniform(0.85, 1.3),
        )

    def car(self, thing: Thing) -> CarShape:
        """Build a car of any kind."""
        rng = rng_of(thing)
        scale = (rng.uniform(0.8, 1.15), rng.uniform(0.92, 1.1), rng.uniform(0.92, 1.25))
        return CarShape(_CABINS[rng.integers(len(_CABINS))], scale)

    def tower(self, thing: Thing) -> TowerLook:
        """Build a tower, painted in bands, in one colour, or bare."""
        rng = rng_of(thing)
        grey = rng.uniform(0.3, 0.8)
        steel = (grey, grey, grey)
        kinds = (
            ((0.86, 0.16, 0.12), (0.95, 0.95, 0.95)),
            ((0.95, 0.40, 0.10), (0.92, 0.92, 0.90)),
            (steel, steel),
        )
        return TowerLook(
            paint=kinds[rng.choice(3, p=[0.45, 0.15, 0.4])],
            taper=rng.uniform(0.15, 0.7),
            section=rng.uniform(1.6, 3.6),
            stout=rng.uniform(0.8, 1.8),
        )


def _cut(rng: np.random.Generator) -> VestCut:
    """One of the usual patterns: two bands, braces and one or two bands, braces alone."""
    lowest = rng.uniform(0.10, 0.32)
    bands = ((lowest, lowest + rng.uniform(0.18, 0.32)), (lowest,), (lowest,))[rng.integers(3)]
    shade = rng.uniform(0.5, 1.0)
    return VestCut(
        colour=hi_vis(rng),
        silver=(shade, shade, shade * rng.uniform(0.95, 1.06)),
        bands=bands,
        band=rng.uniform(0.035, 0.065),
        straps=bool(rng.random() < 0.8),  # noqa: PLR2004 - most have them
        straps_from=max(bands) if rng.integers(2) else min(bands),
        strap=rng.uniform(0.02, 0.04),
        open_sides=rng.choice([0.0, rng.uniform(0.0, 0.05)]),
        hem=rng.uniform(0.0, 0.36),
        flare=rng.uniform(0.0, 0.05),
        open_front=rng.uniform(0.02, 0.09) if rng.random() < _OPEN else 0.0,
        edging=hi_vis(rng) if rng.random() < _EDGED else None,
    )
