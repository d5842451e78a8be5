"""Battery model: power drawn in flight, charge and voltage."""

from __future__ import annotations

import math

from aerodaas.messages.odometry import Battery
from aerodaas.simulation.airframe import AIR_DENSITY, Airframe
from aerodaas.simulation.dynamics import Triple

__all__ = ["FlightBattery", "flight_power"]

_FULL, _KNEE, _EMPTY = 4.2, 3.6, 3.2
"""Open-circuit volts of a lithium-polymer cell at full charge, at `_KNEE_AT`, and empty."""

_KNEE_AT = 0.1
"""Charge at the knee of the discharge curve."""

_INDUCED_ITERATIONS = 4
_SECONDS_PER_HOUR = 3600.0


def flight_power(airframe: Airframe, thrust: Triple, airspeed: Triple) -> float:
    """Electrical power in flight, watts.

    Momentum theory with Glauert's induced velocity in forward flight (Leishman, "Principles of
    Helicopter Aerodynamics", 2nd ed., sections 2.2 and 2.14): induced power, which falls with
    speed, plus the useful power of thrust times airspeed, for climb and drag. Rotors do not charge
    the battery in descent.

    Args:
        airframe: Mass, rotors and avionics of the vehicle.
        thrust: Thrust over mass, ENU m/s².
        airspeed: ENU m/s.
    """
    size = math.sqrt(thrust[0] ** 2 + thrust[1] ** 2 + thrust[2] ** 2)
    if size <= 0.0:
        return airframe.avionics_power
    useful = sum(f * v for f, v in zip(thrust, airspeed, strict=True))
    across = math.sqrt(max(0.0, sum(v * v for v in airspeed) - (useful / size) ** 2))
    hover = math.sqrt(airframe.mass * size / (2.0 * AIR_DENSITY * airframe.disc_area))
    # Climb is included in `useful`; omitting it here keeps the fixed point stable in descent.
    induced = hover
    for _ in range(_INDUCED_ITERATIONS):
        induced = 0.5 * (induced + hover * hover / math.hypot(across, induced))
    ideal = airframe.mass * max(0.0, size * induced + useful)
    return airframe.avionics_power + ideal / airframe.efficiency


class FlightBattery:
    """Battery with coulomb counting and an internal resistance."""

    def __init__(self, airframe: Airframe) -> None:
        """Start at the charge of the settings."""
        self._cells = airframe.cells
        self._resistance = airframe.cells * airframe.cell_resistance
        self._capacity = airframe.capacity * _SECONDS_PER_HOUR
        self.fraction = airframe.battery
        self._voltage = self._open_circuit()
        self._current = 0.0

    def _open_circuit(self) -> float:
        if self.fraction >= _KNEE_AT:
            cell = _KNEE + (_FULL - _KNEE) * (self.fraction - _KNEE_AT) / (1.0 - _KNEE_AT)
        else:
            cell = _EMPTY + (_KNEE - _EMPTY) * self.fraction / _KNEE_AT
        return self._cells * cell

    def drain(self, power: float, duration: float) -> None:
        """Draw power from the battery.

        Args:
            power: Watts.
            duration: Seconds.
        """
        rest = self._open_circuit()
        # The terminal voltage solves U (rest - U) = power * resistance; beyond the greatest
        # possible power the pack delivers that power, at half its rest voltage.
        room = max(0.0, rest * rest - 4.0 * power * self._resistance)
        self._voltage = 0.5 * (rest + math.sqrt(room))
        self._current = power / self._voltage
        self.fraction = max(0.0, self.fraction - self._current * duration / self._capacity)

    @property
    def state(self) -> Battery:
        """Present charge, voltage and current."""
        return Battery(self.fraction, self._voltage, self._current)
