"""Numbers of a stranger's plan: finite, in range, and no truth values or texts."""

from __future__ import annotations

import math

from aerodaas.errors import ConfigError

__all__ = ["LatLon", "finite", "finite_or_none", "place", "whole"]

LatLon = tuple[float, float]
"""Latitude and longitude, WGS84 degrees."""
_POLE = 90.0
_DATE_LINE = 180.0
_SHOWN = 40


def finite(value: object, what: str) -> float:
    """Return a finite number.

    Args:
        value: Value of a file.
        what: Its name, for the error.

    Raises:
        ConfigError: If it is none.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ConfigError(f"{what} must be a finite number, not {repr(value)[:_SHOWN]}")
    return float(value)


def finite_or_none(value: object, what: str) -> float | None:
    """As `finite`, but None stays None: a plan's word for "as it is".

    Args:
        value: Value of a file.
        what: Its name, for the error.

    Raises:
        ConfigError: If it is neither None nor a finite number.
    """
    return None if value is None else finite(value, what)


def whole(value: object, what: str) -> int:
    """Return a whole number that is not negative.

    Args:
        value: Value of a file.
        what: Its name, for the error.

    Raises:
        ConfigError: If it is none.
    """
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ConfigError(f"{what} must be a whole number, not {repr(value)[:_SHOWN]}")
    return value


def place(latitude: object, longitude: object, what: str) -> LatLon:
    """Return latitude and longitude.

    Args:
        latitude: Degrees north, -90 to 90.
        longitude: Degrees east, -180 to 180.
        what: Name of the place, for the error.

    Raises:
        ConfigError: For what is no place on the globe.
    """
    north, east = finite(latitude, f"{what}: latitude"), finite(longitude, f"{what}: longitude")
    if abs(north) > _POLE or abs(east) > _DATE_LINE:
        remedy = "give -90 to 90 and -180 to 180"
        if abs(east) <= _POLE and abs(north) <= _DATE_LINE:
            remedy = "are the two exchanged?"
        raise ConfigError(
            f"{what}: ({north:.10g}, {east:.10g}) is no latitude and longitude in degrees; {remedy}"
        )
    return north, east
