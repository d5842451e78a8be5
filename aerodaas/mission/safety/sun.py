"""Height of the sun, for daylight."""

from __future__ import annotations

import math

__all__ = ["sun_elevation"]

_DAY = 86400.0
_J2000 = 946_728_000.0
"""Seconds since the Unix epoch at the epoch J2000.0, 1 January 2000, 12:00."""


def sun_elevation(latitude: float, longitude: float, clock: float) -> float:
    """Degrees of the sun above the horizon, without refraction.

    `latitude` and `longitude` are degrees, `clock` seconds since the Unix epoch. Accurate to 0.02
    degrees between 1950 and 2050: the low-precision formulas of the Astronomical Almanac (US Naval
    Observatory, "Computing approximate solar coordinates").
    """
    days = (clock - _J2000) / _DAY
    anomaly = math.radians(357.529 + 0.98560028 * days)
    mean = 280.459 + 0.98564736 * days
    ecliptic = math.radians(mean + 1.915 * math.sin(anomaly) + 0.020 * math.sin(2 * anomaly))
    tilt = math.radians(23.439 - 0.00000036 * days)
    ascension = math.atan2(math.cos(tilt) * math.sin(ecliptic), math.cos(ecliptic))
    declination = math.asin(math.sin(tilt) * math.sin(ecliptic))
    sidereal = math.radians(15.0 * (18.697374558 + 24.06570982441908 * days) + longitude)
    hour, place = sidereal - ascension, math.radians(latitude)
    height = math.sin(place) * math.sin(declination)
    height += math.cos(place) * math.cos(declination) * math.cos(hour)
    return math.degrees(math.asin(max(-1.0, min(1.0, height))))
