"""How much battery a flight takes: from speed, distance, hover and wind to charge.

The power of a rotary wing over its airspeed V is the sum of the blades' profile power, the
induced power and the parasite drag (Zeng, Xu and Zhang, "Energy Minimization for Wireless
Communication With Rotary-Wing UAV", IEEE Trans. Wireless Communications 18(4), 2019, eq. 12).
It is used here relative to the power in hover, so that a drone's endurance in hover is the only
figure that has to be known. The constants are those of the paper's table I.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import Vector, is_finite, length
from aerodaas.messages.serialization.records import valued
from aerodaas.messages.waypoints import Waypoint

__all__ = ["EnergyMeter", "EnergyModel"]

_PROFILE = 79.86 / (79.86 + 88.63)
"""Share of the blades' profile power in hover (the paper's P0 of P0 + Pi)."""
_INDUCED = 1.0 - _PROFILE
_TIP_SPEED = 120.0
"""Speed of the rotor blades' tips, m/s."""
_INDUCED_VELOCITY = 4.03
"""Mean velocity that the rotors induce in hover, m/s."""
_PARASITE = 0.5 * 0.6 * 1.225 * 0.05 * 0.503 / (79.86 + 88.63)
"""Drag power over V cubed (d0 rho s A / 2), relative to hover."""


Amount = TypeVar("Amount", float, NDArray[np.float64])


def _power(squared: Amount, up: Amount, sqrt: Callable[[Amount], Amount]) -> Amount:
    """Power relative to hover at the square of a level airspeed and a vertical one, m/s.

    For one number as well as for many, by the `sqrt` of either: NumPy takes ten times as long for
    one. Products where powers might be, for those of a number too large would raise.
    """
    ratio = squared / (2 * _INDUCED_VELOCITY**2)
    induced = sqrt(sqrt(1 + ratio * ratio) - ratio)
    climb = (up + abs(up)) / (2 * _INDUCED_VELOCITY)
    return (
        _PROFILE * (1 + 3 * squared / _TIP_SPEED**2)
        + _INDUCED * (induced + climb)
        + _PARASITE * squared * sqrt(squared)
    )


@valued
@dataclass(frozen=True)
class EnergyModel:
    """Charge (0 to 1) that flying takes."""

    endurance: float = 900.0
    """Seconds that a full battery hovers."""
    wind: Vector = field(default_factory=lambda: np.zeros(3))
    """Mean wind, ENU m/s."""

    def power(self, velocity: Vector) -> float:
        """Power relative to hover at a ground `velocity` (ENU m/s); about 1 or less up to 15 m/s.

        A climb adds the work against gravity; a descent is counted as level flight.
        """
        air: list[float] = (velocity - self.wind).tolist()
        east, north, up = air
        return _power(east * east + north * north, up, math.sqrt)

    @cached_property
    def _hover_power(self) -> float:
        return self.power(np.zeros(3))

    def powers(self, velocities: NDArray[np.float64]) -> NDArray[np.float64]:
        """`power` of many velocities, (..., 3) to (...)."""
        air = velocities - self.wind
        return _power(air[..., 0] ** 2 + air[..., 1] ** 2, air[..., 2], np.sqrt)

    def hover(self, duration: float) -> float:
        """Charge for `duration` seconds in one place."""
        return self._hover_power * duration / self.endurance

    def leg(self, start: Vector, end: Vector, speed: float) -> float:
        """Charge for a straight way, as a fraction of the battery.

        Args:
            start: ENU metres.
            end: ENU metres.
            speed: Metres per second over ground.
        """
        way = end - start
        distance = length(way)
        if distance == 0.0:
            return 0.0
        return self.power(way * (speed / distance)) * distance / speed / self.endurance

    def route(
        self, start: Vector, waypoints: Iterable[Waypoint], home: Vector, speed: float
    ) -> float:
        """Charge for visiting waypoints in order, with their hovers, and coming home.

        Args:
            start: ENU metres.
            waypoints: Local waypoints, in order.
            home: ENU metres.
            speed: Metres per second, where a waypoint has no own speed.

        Returns:
            Fraction of the battery.
        """
        charge, here = 0.0, start
        for waypoint in waypoints:
            there = waypoint.position
            charge += self.leg(here, there, waypoint.speed or speed)
            charge += self.hover(waypoint.hover_duration)
            here = there
        return charge + self.way_home(here, home, speed)

    def way_home(self, position: Vector, home: Vector, speed: float) -> float:
        """Charge for flying to above home and descending there at 0.5 m/s.

        Args:
            position: ENU metres.
            home: ENU metres.
            speed: Metres per second.

        Returns:
            Fraction of the battery.
        """
        descent_speed = 0.5
        above = np.array([home[0], home[1], position[2]])
        descent = max(0.0, float(position[2] - home[2])) / descent_speed
        return self.leg(position, above, speed) + self.hover(descent)


class EnergyMeter:
    """Compares the charge that a flight took with the model, and scales the model by it.

    A battery that is older than its data sheet, or an unknown wind, shows here. The
    scale never makes the model more hopeful than it was.
    """

    _TELLING = 0.02
    """Charge that must have been spent before the comparison means anything."""

    def __init__(self, model: EnergyModel) -> None:
        """Compare with `model`."""
        self.model = model
        self._first: float | None = None
        self._spent = 0.0
        self._expected = 0.0

    def observe(self, fraction: float, velocity: Vector, duration: float) -> None:
        """Add the battery's charge after a time of flight.

        Args:
            fraction: Charge, 0 to 1.
            velocity: Velocity of the flight, ENU m/s.
            duration: Seconds since the last charge.
        """
        if not (math.isfinite(fraction) and is_finite(velocity)):
            return
        if self._first is None:
            self._first = fraction
            return
        self._spent = self._first - fraction
        self._expected += self.model.power(velocity) * duration / self.model.endurance

    @property
    def scale(self) -> float:
        """Factor on the model's figures, 1 or more."""
        if self._spent < self._TELLING or self._expected <= 0.0:
            return 1.0
        return max(1.0, self._spent / self._expected)

    def hover(self, duration: float) -> float:
        """Charge for `duration` seconds in one place, by the model as scaled."""
        return self.scale * self.model.hover(duration)

    def way_home(self, position: Vector, home: Vector, speed: float) -> float:
        """Charge as `EnergyModel.way_home` has it, by the scaled model."""
        return self.scale * self.model.way_home(position, home, speed)

    def route(
        self, start: Vector, waypoints: Iterable[Waypoint], home: Vector, speed: float
    ) -> float:
        """Charge as `EnergyModel.route` has it, by the scaled model."""
        return self.scale * self.model.route(start, waypoints, home, speed)
