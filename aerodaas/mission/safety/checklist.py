"""The list before take-off: everything that is known of the vehicle's health, judged by policy."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from aerodaas.config.extensions import added
from aerodaas.config.model import LimitsConfig
from aerodaas.config.sections.preflight import PreflightConfig, PreflightLevel
from aerodaas.errors import VehicleError
from aerodaas.messages.health import (
    OWN_CHECKS,
    HealthItem,
    HealthReadings,
    MeasuredVehicle,
    Verdict,
)
from aerodaas.messages.payload import CameraStatus
from aerodaas.messages.vehicle import Vehicle, VehicleState
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.supervisor import charge_objection, place_objections

__all__ = ["Checklist", "PreflightCheck", "concerns", "refusals", "sun_elevation"]

_DAY = 86400.0
_J2000 = 946_728_000.0
"""Seconds since the Unix epoch at the epoch J2000.0, 1 January 2000, 12:00."""


def sun_elevation(latitude: float, longitude: float, clock: float) -> float:
    """Degrees of the sun above the horizon, without refraction.

    Accurate to 0.02 degrees between 1950 and 2050: the low-precision formulas of the Astronomical
    Almanac (US Naval Observatory, "Computing approximate solar coordinates").

    Args:
        latitude: Degrees, north positive.
        longitude: Degrees, east positive.
        clock: Seconds since the Unix epoch.
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


_NOT_KNOWN = "not known"
_CELL_SPREAD = 0.15
"""Volts between the best and the worst cell of a sound battery at most."""
_SUBJECTS = {
    "GPS": "gps",
    "battery": "cells",
    "compass": "compass",
    "compasses": "compass",
    "second compass": "compass",
    "estimator": "estimator",
    "log": "storage",
    "vibration": "vibration",
    "wind": "wind",
}
"""The item to which a fault of the vehicle belongs, by the fault's first word."""
_REMEDIES = {
    "battery": "charge the battery",
    "cells": "charge and balance the battery; retire one whose cells differ",
    "battery_age": "take a newer battery",
    "vibration": "look at propellers, motors and the autopilot's mounting",
    "compass": "move away from metal and wires, or calibrate the compass",
    "gps": "wait, or move away from walls and trees",
    "estimator": "let it stand still for a minute; calibrate what does not fit",
    "camera": "put a card with room into the camera, or look at its cable",
    "storage": "put a working card into the autopilot, or free space on it",
    "wind": "wait for less wind",
    "daylight": "wait for daylight; preflight.sun_elevation where a flight at night is legal",
    "fence": "move the drone, or mend limits.geofence",
    "fallback": '"fallback": "set" in the settings of the robot (docs/mavlink.md)',
    "link": "look at antennas, cables and the address",
    OWN_CHECKS: "do what it says",
}


@dataclass(frozen=True)
class PreflightCheck:
    """An item that an extension adds to the list (`Extension.preflight_checks`)."""

    name: str
    remedy: str
    """What to do about a warning or a refusal."""
    examine: Callable[[VehicleState, HealthReadings], HealthItem | None]
    """Returns the item by the newest state and readings; None if there is nothing to say."""
    level: PreflightLevel | None = None
    """What a finding means; None: the verdict of `examine` stands."""
    subject: str = ""
    """First words, up to a colon, of the vehicle's faults that belong to the item; empty: none."""


class Checklist:
    """The list of one robot, read from one vehicle."""

    def __init__(self, vehicle: Vehicle, limits: LimitsConfig, policy: PreflightConfig) -> None:
        """Judge by `limits` and `policy`; raises ConfigError for an invalid geofence."""
        self._vehicle = vehicle
        # Once: to ask a protocol about an instance looks up all its members.
        self._measured = vehicle if isinstance(vehicle, MeasuredVehicle) else None
        self._limits = limits
        self._policy = policy
        self._fence = Geofence(limits.geofence)
        self._checks: list[PreflightCheck] = [
            check(limits, policy) for check in added("preflight_checks")
        ]
        self._subjects = _SUBJECTS | {one.subject: one.name for one in self._checks if one.subject}
        self._remedies = _REMEDIES | {one.name: one.remedy for one in self._checks}

    def examine(self, state: VehicleState) -> list[HealthItem]:
        """Every item that the policy does not ignore; `state` is the newest."""
        told, objections = self._told(), self._vehicle.preflight()
        own = HealthItem(OWN_CHECKS, "; ".join(objections) or "ready", "", Verdict.GOOD)
        items = [
            _by(objections, own),
            self._battery(state),
            self._place(state),
        ]
        cameras = [one.name for one in told.cameras or ()]
        faults = _faults(state.faults, {**self._subjects, **dict.fromkeys(cameras, "camera")})
        for item in self._health(state, told):
            level: PreflightLevel = getattr(self._policy, item.name)
            if level != "ignore":
                items.append(_judged(item, level, faults.get(item.name, [])))
        for check in self._checks:
            found = check.examine(state, told)
            if found is not None and check.level != "ignore":
                texts = faults.get(check.name, [])
                items.append(_judged(found, check.level, texts) if check.level else found)
        others = [text for text in faults.get("", []) if text not in objections]
        if others:
            items.append(HealthItem("faults", "; ".join(others), "", Verdict.WARNING))
        return [_remedied(one, self._remedies) for one in items]

    def _told(self) -> HealthReadings:
        if self._measured is not None:
            with contextlib.suppress(VehicleError):  # its own objections say what is missing
                return self._measured.health()
        return HealthReadings()

    def _battery(self, state: VehicleState) -> HealthItem:
        limits, charge = self._limits, state.battery.fraction
        known = math.isfinite(charge)
        volts = f", {state.battery.voltage:.1f} V" if state.battery.voltage else ""
        item = HealthItem(
            "battery",
            f"{charge:.0%}{volts}" if known else _NOT_KNOWN,
            f"more than {limits.battery_return:.0%}",
            Verdict.GOOD if known else Verdict.UNKNOWN,
        )
        return _by([one for one in [charge_objection(state, limits)] if one], item)

    def _place(self, state: VehicleState) -> HealthItem:
        objections = place_objections(state, self._limits, self._fence)
        value = "; ".join(objections) or "inside, and so is the take-off"
        return _by(objections, HealthItem("fence", value, "inside", Verdict.GOOD))

    def _health(self, state: VehicleState, told: HealthReadings) -> Iterator[HealthItem]:
        policy = self._policy
        yield self._cells(told.cells)
        yield _most("battery_age", told.cycles, policy.battery_cycles, "{:g} cycles")
        yield _most("vibration", told.vibration, policy.most_vibration, "{:.1f} m/s²")
        yield _most("compass", told.compass, policy.misfit, "misfit {:.2f}")
        yield self._gps(state, told)
        yield _most("estimator", told.estimator, policy.misfit, "misfit {:.2f}")
        yield self._storage(told.logs)
        yield _most("wind", told.wind, policy.wind_speed, "{:.1f} m/s")
        yield self._daylight(state, told.clock)
        yield _most("link", told.silence, policy.silence, "last word {:.1f} s ago")
        yield _texts("fallback", told.stranded, "able to come home without us")
        yield _camera(told.cameras or ())

    def _cells(self, cells: tuple[float, ...] | None) -> HealthItem:
        least = self._policy.cell_voltage
        bound = f"at least {least:.2f} V, at most {_CELL_SPREAD:.2f} V apart"
        if not cells:
            return _unknown("cells", bound)
        apart = max(cells) - min(cells)
        good = min(cells) >= least and apart <= _CELL_SPREAD
        value = f"{len(cells)} cells from {min(cells):.2f} V, {apart:.2f} V apart"
        return HealthItem("cells", value, bound, _verdict(good=good))

    def _gps(self, state: VehicleState, told: HealthReadings) -> HealthItem:
        policy, gps = self._policy, state.gps
        bound = f"{policy.satellites} satellites, within {policy.gps_accuracy:g} m"
        if told.gps_fix is None and gps is None:
            return _unknown("gps", bound)
        if gps is None or told.gps_fix is False:
            return HealthItem("gps", "no fix", bound, Verdict.REFUSED)
        # Zero is a driver's word for what it is not told.
        few = 0 < gps.satellites < policy.satellites
        good = not few and gps.horizontal_sigma <= policy.gps_accuracy
        known = f"{gps.satellites} satellites" if gps.satellites else "a fix"
        corrected = f", {told.gps_rtk}" if told.gps_rtk else ""
        value = f"{known}, within {gps.horizontal_sigma:.1f} m{corrected}"
        return HealthItem("gps", value, bound, _verdict(good=good))

    @staticmethod
    def _storage(writes: bool | None) -> HealthItem:  # noqa: FBT001 - a reading
        bound = "able to write its log"
        if writes is None:
            return _unknown("storage", bound)
        value = "it writes its log" if writes else "it does not write its log"
        return HealthItem("storage", value, bound, _verdict(good=writes))

    def _daylight(self, state: VehicleState, clock: float | None) -> HealthItem:
        least = self._policy.sun_elevation
        bound = f"at least {least:g}°"
        if clock is None or state.gps is None:
            return _unknown("daylight", bound)
        height = sun_elevation(state.gps.latitude, state.gps.longitude, clock)
        return HealthItem(
            "daylight", f"sun at {height:.0f}°", bound, _verdict(good=height >= least)
        )


def refusals(items: Sequence[HealthItem]) -> list[str]:
    """Reasons that keep the drone on the ground by the items, one sentence each.

    Without battery and fence, which the mission's supervisor refuses itself.
    """
    refused = [one for one in items if one.verdict is Verdict.REFUSED]
    return [one.text for one in refused if one.name not in {"battery", "fence"}]


def concerns(items: Sequence[HealthItem]) -> list[str]:
    """Warnings that do not keep the drone on the ground; one sentence each.

    Without faults, which the mission tells itself in flight, and the fallback, which a driver tells
    when it connects.
    """
    return [
        one.text
        for one in items
        if one.verdict is Verdict.WARNING and one.name not in {"faults", "fallback"}
    ]


def _verdict(*, good: bool) -> Verdict:
    return Verdict.GOOD if good else Verdict.REFUSED


def _unknown(name: str, bound: str) -> HealthItem:
    return HealthItem(name, _NOT_KNOWN, bound, Verdict.UNKNOWN)


def _most(name: str, value: float | None, most: float, form: str) -> HealthItem:
    bound = f"at most {most:g}"
    if value is None or not math.isfinite(value):
        return _unknown(name, bound)
    return HealthItem(name, form.format(value), bound, _verdict(good=value <= most))


def _texts(name: str, objections: Sequence[str] | None, good: str) -> HealthItem:
    if objections is None:
        return _unknown(name, good)
    said = "; ".join(one for one in objections if one)
    return HealthItem(name, said or good, good, _verdict(good=not said))


def _camera(cameras: Sequence[CameraStatus]) -> HealthItem:
    bound = "able to keep pictures"
    if not cameras:
        return _unknown("camera", bound)
    bad = any(one.trouble for one in cameras)
    said = (f"{one.name}: {one}" + (f"; {one.trouble}" if one.trouble else "") for one in cameras)
    return HealthItem("camera", "; ".join(said), bound, _verdict(good=not bad))


def _by(objections: Sequence[str], item: HealthItem) -> HealthItem:
    """An item that is no matter of policy."""
    return replace(item, verdict=Verdict.REFUSED) if objections else item


def _judged(item: HealthItem, level: PreflightLevel, faults: Sequence[str]) -> HealthItem:
    """The item by its level; what the vehicle itself says of it counts most."""
    if faults:
        item = replace(item, value="; ".join(faults), verdict=Verdict.REFUSED)
    if item.verdict is Verdict.UNKNOWN and level == "require":
        return replace(item, verdict=Verdict.REFUSED)
    if item.verdict is Verdict.REFUSED and level == "warn":
        return replace(item, verdict=Verdict.WARNING)
    return item


def _remedied(item: HealthItem, remedies: Mapping[str, str]) -> HealthItem:
    if item.verdict in {Verdict.GOOD, Verdict.UNKNOWN}:
        return item
    return replace(item, remedy=remedies.get(item.name, ""))


def _faults(texts: Sequence[str], subjects: Mapping[str, str]) -> dict[str, list[str]]:
    """The vehicle's faults by item; those of none under an empty name."""
    found: dict[str, list[str]] = {}
    for text in texts:
        subject, colon, rest = text.partition(": ")
        name = subjects.get(subject, "") if colon else ""
        found.setdefault(name, []).append(rest if name else text)
    return found
