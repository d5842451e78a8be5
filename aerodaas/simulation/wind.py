"""Wind model: constant mean and seeded gusts with a correlation time of a few seconds."""

from __future__ import annotations

import math
import random

__all__ = ["Wind"]

_GUST_TIME = 2.5
"""Correlation time in seconds: a turbulence length of some 10 m at a wind of 4 m/s, as in the
low-altitude Dryden model (MIL-F-8785C) for a few metres above the ground."""

_VERTICAL_SHARE = 0.5
"""Ratio of vertical to horizontal gusts close to the ground, about one half (same source)."""


class Wind:
    """An Ornstein-Uhlenbeck process per axis, the first-order Dryden spectrum.

    `mean` is ENU m/s, `gust` the standard deviation of the horizontal gusts in m/s. `step`
    advances by the fixed step `dt` in seconds with the exact discretisation, so that the spectrum
    does not depend on `dt`.
    """

    __slots__ = ("_draw", "_gust", "_keep", "_mean", "_stir", "_up", "velocity")

    def __init__(self, mean: tuple[float, float, float], gust: float, seed: str, dt: float) -> None:
        """Start in the stationary distribution."""
        self._mean = mean
        self._draw = random.Random(seed).gauss
        self._keep = math.exp(-dt / _GUST_TIME)
        self._stir = gust * math.sqrt(1.0 - self._keep * self._keep)
        self._up = self._stir * _VERTICAL_SHARE
        draw = self._draw
        self._gust = (draw(0, gust), draw(0, gust), draw(0, gust * _VERTICAL_SHARE))
        self.velocity = self._sum()
        """Present wind, ENU m/s."""

    def _sum(self) -> tuple[float, float, float]:
        mean, gust = self._mean, self._gust
        return mean[0] + gust[0], mean[1] + gust[1], mean[2] + gust[2]

    def step(self) -> None:
        """Advance by one step."""
        if self._stir > 0.0:
            gust, keep, stir, draw = self._gust, self._keep, self._stir, self._draw
            self._gust = (
                keep * gust[0] + draw(0.0, stir),
                keep * gust[1] + draw(0.0, stir),
                keep * gust[2] + draw(0.0, self._up),
            )
            self.velocity = self._sum()
