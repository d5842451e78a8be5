"""Airframe of a simulated drone: the settings of the simulated driver.

The defaults describe a 2 kg quadrotor with 10-inch rotors and a 4-cell 5 Ah battery, with about
20 minutes of hover: the class of the Holybro X500, PX4's own default simulation model.
"""

from __future__ import annotations

import math
import random
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator
from typing_extensions import Self

__all__ = ["AIR_DENSITY", "GRAVITY", "Airframe", "RangefinderSettings", "Wind"]

GRAVITY = 9.80665
"""Standard gravity, m/s^2."""

AIR_DENSITY = 1.225
"""Air density at sea level, International Standard Atmosphere, kg/m^3."""

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1)]


class RangefinderSettings(BaseModel):
    """Range and noise of a rangefinder that looks down; by default those of small lidars."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    min_range: NotNegative = 0.2
    """Metres; what is nearer is told as this."""
    max_range: Positive = 12.0
    """Metres; what is farther is not told."""
    noise: NotNegative = 0.02
    """Standard deviation of a reading in metres, at `simulation.sensor_noise` 1."""

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.min_range >= self.max_range:
            message = (
                f"min_range ({self.min_range:g} m) must be below max_range ({self.max_range:g} m)"
            )
            raise ValueError(message)
        return self


class Airframe(BaseModel):
    """Mass, rotors, drag, battery and limits of a simulated multirotor."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    mass: Positive = 2.0
    """Kilograms, battery included."""
    rotors: Annotated[int, Field(ge=3, le=16)] = 4
    rotor_radius: Positive = 0.127
    """Metres."""
    efficiency: Annotated[float, Field(gt=0, le=1)] = 0.6
    """Ideal power over electrical power: rotors, motors and controllers together."""
    avionics_power: NotNegative = 10.0
    """Constant power in watts, in flight and on the ground."""
    rotor_drag: NotNegative = 0.15
    """Linear drag of the rotors, (m/s^2) per m/s of airspeed."""
    body_drag: NotNegative = 0.02
    """Quadratic drag of the body, (m/s^2) per (m/s)^2 of airspeed."""
    thrust_to_weight: Annotated[float, Field(ge=1.2, le=6)] = 2.0
    max_tilt: Annotated[float, Field(ge=5, le=60)] = 30.0
    """Degrees."""
    max_speed: Positive = 12.0
    """Greatest horizontal speed in m/s, regardless of the mission's limits."""
    max_climb: Positive = 3.0
    """Greatest vertical speed in m/s."""
    landing_speed: Annotated[float, Field(gt=0, le=2)] = 0.4
    """Downward speed close to the ground, m/s."""
    cells: Annotated[int, Field(ge=1, le=24)] = 4
    capacity: Positive = 5.0
    """Ampere-hours."""
    cell_resistance: NotNegative = 0.006
    """Ohms per cell."""
    battery: Fraction = 1.0
    """Charge at the start, 0 to 1."""
    battery_minimum: Fraction = 0.15
    """Charge below which a takeoff is refused."""
    battery_failsafe: Fraction = 0.05
    """Charge below which it lands by itself, overriding all commands."""
    rangefinder: RangefinderSettings | None = RangefinderSettings()
    """Heeded where `limits.rangefinder_clearance` is set; None: it has none."""

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.battery_failsafe > self.battery_minimum:
            message = (
                f"battery_failsafe ({self.battery_failsafe:g}) must not exceed "
                f"battery_minimum ({self.battery_minimum:g})"
            )
            raise ValueError(message)
        return self

    @property
    def disc_area(self) -> float:
        """Area swept by all rotors, m^2."""
        return self.rotors * math.pi * self.rotor_radius**2


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
