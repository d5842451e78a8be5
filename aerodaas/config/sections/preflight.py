"""What is looked at before take-off, and what a finding means."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field

from aerodaas.config.checked import Extensible, Finite, Positive
from aerodaas.config.extensions import SettingsSection

__all__ = ["PreflightConfig", "PreflightLevel"]

PreflightLevel: TypeAlias = Literal["ignore", "warn", "refuse", "require"]
"""What a finding means: nothing, a warning, no take-off, or none unless it is known to be good."""


class PreflightConfig(Extensible):
    """The health of the vehicle and its surroundings before take-off.

    Each item is at one of the levels `ignore`, `warn`, `refuse` (no take-off) and `require` (nor if
    it is not known). Whether the battery, the geofence and the vehicle's own checks allow a
    take-off is no matter of policy.
    """

    section: ClassVar[SettingsSection] = "preflight"

    cells: PreflightLevel = "warn"
    """Voltage of each cell of the battery."""
    battery_age: PreflightLevel = "warn"
    """Charging cycles of the battery."""
    vibration: PreflightLevel = "warn"
    """Vibration while it stands."""
    compass: PreflightLevel = "warn"
    """How well the compass fits what the estimator expects."""
    gps: PreflightLevel = "warn"
    """Satellites and accuracy of the GPS."""
    estimator: PreflightLevel = "warn"
    """How well position, velocity and height fit what the estimator expects."""
    storage: PreflightLevel = "warn"
    """Whether the vehicle can write its own log."""
    wind: PreflightLevel = "warn"
    """Speed of the wind."""
    daylight: PreflightLevel = "warn"
    """Height of the sun where it stands."""
    link: PreflightLevel = "warn"
    """Age of the vehicle's last word."""
    fallback: PreflightLevel = "warn"
    """Whether it comes home by itself once this process is gone."""
    camera: PreflightLevel = "warn"
    """Whether each camera that tells of its card has room on it."""
    cell_voltage: Positive = 3.5
    """Volts of a cell at least."""
    battery_cycles: Annotated[int, Field(ge=1)] = 300
    """Charging cycles at most."""
    most_vibration: Positive = 15.0
    """m/s² at most."""
    misfit: Positive = 0.8
    """Share at most, of 1, from which the estimator rejects a sensor."""
    satellites: Annotated[int, Field(ge=4)] = 6
    """Satellites at least."""
    gps_accuracy: Positive = 5.0
    """Metres of the GPS' standard deviation along the ground at most."""
    wind_speed: Positive = 10.0
    """m/s at most."""
    sun_elevation: Finite = -6.0
    """Degrees of the sun above the horizon at least; -6 is the end of civil twilight."""
    silence: Positive = 1.5
    """Seconds since the vehicle's last word at most."""
