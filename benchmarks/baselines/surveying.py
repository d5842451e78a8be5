"""Legs of a survey, with reports on the way."""

from __future__ import annotations

import time

from ardupilot_copter import Copter


def report(copter: Copter) -> str:
    """Battery, height and GPS position."""
    status, place = copter.newest("SYS_STATUS"), copter.newest("GLOBAL_POSITION_INT")
    height, where = place.relative_alt / 1e3, f"{place.lat / 1e7:.6f}, {place.lon / 1e7:.6f}"
    return f"battery {status.battery_remaining} %, height {height:.1f} m, gps {where}"


def fly_to(copter: Copter, place: tuple[float, float, float]) -> None:
    """Fly to a place, and report on the way."""
    while not copter.is_at(place):
        copter.go_to(place)
        print(report(copter))
        time.sleep(0.2)
