"""ArduCopter: guided, modes by number, take-off to a height above home."""

from __future__ import annotations

import re
from typing import ClassVar

from aerodaas.drivers.mavlink.autopilots.autopilot import (
    Autopilot,
    Failsafe,
    FallbackParameter,
    FenceAction,
    return_height,
)
from aerodaas.drivers.mavlink.microservices.commander import PendingCommand
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["ArduPilot"]

_AUTO, _GUIDED, _LAND, _RETURN, _BRAKE = 3, 4, 9, 6, 17
_ASKED = {
    FlightMode.GUIDED: _GUIDED,
    FlightMode.TAKE_OFF: _GUIDED,
    # Loiter would follow the throttle of a possibly missing remote control, and sink.
    FlightMode.HOLD: _BRAKE,
    FlightMode.MISSION: _AUTO,
    FlightMode.RETURN: _RETURN,
    FlightMode.LAND: _LAND,
}
_NAMES = {
    0: "stabilize",
    1: "acro",
    2: "altitude hold",
    _AUTO: "auto",
    _GUIDED: "guided",
    5: "loiter",
    _RETURN: "return",
    7: "circle",
    _LAND: "land",
    11: "drift",
    13: "sport",
    14: "flip",
    15: "autotune",
    16: "position hold",
    _BRAKE: "brake",
    18: "throw",
    20: "guided without GPS",
    21: "smart return",
    27: "automatic return",
}
_KNOWN = {
    _AUTO: FlightMode.MISSION,
    _GUIDED: FlightMode.GUIDED,
    _BRAKE: FlightMode.HOLD,
    _RETURN: FlightMode.RETURN,
    21: FlightMode.RETURN,
    _LAND: FlightMode.LAND,
}
_LOST = {"return": 1.0, "retrace": 3.0}
"""FS_GCS_ENABLE: return to launch; the flown way back (SmartRTL), or a return where that is too
long to remember."""
_COMES_HOME = {*_LOST.values(), 6.0}
"""Those with which it comes home; 6 by the mission's return path, or straight without one."""
_WAYS = {"return": "come home", "retrace": "fly the flown way back"}
_LANDS_ON = 1 << 3
"""Bit of FS_OPTIONS: a landing goes on."""
_PROTECTS = re.compile(r"failsafe|breached|EKF|crash|thrust|battery.*(low|critical)", re.IGNORECASE)
"""Texts of its own protection."""
_TALK = 35.0
"""Seconds: longer than the 30 s between its repeated objections."""


class ArduPilot(Autopilot):
    """ArduCopter 4.3 and later."""

    name: ClassVar[str] = "ArduPilot"
    family: ClassVar[int] = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    stream_before: ClassVar[float] = 0.0
    stops_short: ClassVar[float] = 0.0
    alone: ClassVar[str] = (
        "ArduPilot stops within 3 s and hovers until a pilot lands it; it comes home only with "
        'a "fallback" (docs/mavlink.md)'
    )
    comes_home: ClassVar[str] = (
        "ArduPilot stops within 3 s, and comes home by its ground-station failsafe"
    )
    ways_home: ClassVar[frozenset[str]] = frozenset({"return", "retrace"})
    home_comes_first: ClassVar[bool] = True
    turns_at_waypoints: ClassVar[bool] = False
    rates: ClassVar[dict[int, float]] = {
        **Autopilot.rates,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: 2.0,
        mavlink.MAVLINK_MSG_ID_FENCE_STATUS: 2.0,
    }
    failsafes: ClassVar[tuple[Failsafe, ...]] = (
        Failsafe(
            "BATT_FS_LOW_ACT",
            frozenset({0.0}),
            2.0,
            "a low battery only leads to a warning",
        ),
        Failsafe(
            "FS_EKF_ACTION",
            frozenset({0.0}),
            1.0,
            "the loss of its position is only reported",
        ),
    )

    def mode(self, custom_mode: int) -> FlightMode:
        """The flight mode of a HEARTBEAT."""
        return _KNOWN.get(custom_mode, FlightMode.OTHER)

    def mode_name(self, custom_mode: int) -> str:
        """The mode's usual name."""
        return _NAMES.get(custom_mode, f"mode {custom_mode}")

    def ask_mode(self, mode: FlightMode) -> PendingCommand:
        """Command one of its modes."""
        values = (1.0, float(_ASKED[mode]), 0.0, 0.0, 0.0, 0.0, 0.0)
        return PendingCommand(mavlink.MAV_CMD_DO_SET_MODE, values, f"mode {mode.value}", mode=mode)

    def take_off(self, height: float, telemetry: Telemetry) -> tuple[PendingCommand, ...]:
        """Guided first, then arm, then climb: it takes off in guided mode only."""
        del telemetry
        climb = PendingCommand(
            mavlink.MAV_CMD_NAV_TAKEOFF,
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height),
            "take off",
            mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
            FlightMode.TAKE_OFF,
        )
        return self.ask_mode(FlightMode.GUIDED), self.arm(), climb

    def ready(self, telemetry: Telemetry) -> bool | None:
        """Whether it has the arming check, and whether that passes."""
        sensors, check = telemetry.sensors, mavlink.MAV_SYS_STATUS_PREARM_CHECK
        if sensors is None or not sensors.present & check:
            return None
        return bool(sensors.health & check)

    def objections(self, telemetry: Telemetry, now: float) -> list[str]:
        """Its PreArm texts."""
        if self.ready(telemetry) is not False:
            return []
        said = [
            text
            for text in telemetry.texts.recent(now, _TALK)
            if text.startswith(("PreArm:", "Arm:"))
        ]
        return said or ["ArduPilot's arming checks fail"]

    def protection_reasons(self, telemetry: Telemetry, now: float, seconds: float) -> list[str]:
        """Its fence's status, and its texts about failsafes, of whatever severity they are.

        Args:
            telemetry: What the vehicle has told so far.
            now: Monotonic clock, seconds.
            seconds: Age up to which texts count.
        """
        said = telemetry.texts.recent(now, seconds, mavlink.MAV_SEVERITY_NOTICE)
        telling = [text for text in said if _PROTECTS.search(text) and "clear" not in text.lower()]
        return [telemetry.breach, *telling] if telemetry.breach else telling

    def encode(self, value: float, kind: int) -> float:
        """Every parameter travels as a float."""
        del kind
        return value

    def decode(self, value: float, kind: int) -> float:
        """Every parameter travels as a float."""
        del kind
        return value

    def fallback(
        self, settings: MavlinkSettings, ceiling: float, software: str
    ) -> tuple[FallbackParameter, ...]:
        """Its ground-station failsafe, which must listen to our system id alone.

        Names and meanings as in ArduCopter 4.3 to 4.7 (ArduCopter/Parameters.cpp and events.cpp,
        libraries/GCS_MAVLink/GCS.cpp): 4.7 renamed SYSID_MYGCS and made a range of it, and gives
        heights in metres instead of centimetres.

        Args:
            settings: Our system id, and when and how it is to come home.
            ceiling: Ceiling of the geofence, metres above home.
            software: Ignored.
        """
        del software
        ours, after = float(settings.own_system), settings.fallback_after
        action = _LOST[settings.way_home]
        fits = _COMES_HOME if settings.way_home == "return" else {action}
        return (
            FallbackParameter(
                ("MAV_GCS_SYSID", "SYSID_MYGCS"),
                lambda value: value == ours,
                ours,
                f"it does not notice our silence, who are system {ours:g}",
            ),
            FallbackParameter(
                ("MAV_GCS_SYSID_HI",),
                lambda value: value <= ours,
                0.0,
                "other systems' heartbeats hide our silence",
                beside="MAV_GCS_SYSID",
            ),
            FallbackParameter(
                ("FS_GCS_TIMEOUT",),
                lambda value: value <= after,
                after,
                f"it acts later than {after:g} s after our last word",
            ),
            return_height(ceiling, "RTL_ALT_M", "RTL_ALT", scales=(1.0, 100.0)),
            FallbackParameter(
                ("RTL_ALT_FINAL_M", "RTL_ALT_FINAL"),
                lambda metres: metres <= 0.0,
                0.0,
                "it would hover over its home instead of landing",
            ),
            FallbackParameter(
                ("FS_OPTIONS",),
                lambda value: bool(int(value) & _LANDS_ON),
                float(_LANDS_ON),
                "a landing that we have commanded would end in a return when we are silent",
                bits=True,
            ),
            FallbackParameter(
                ("FS_GCS_ENABLE",),
                lambda value: value in fits,
                action,
                f"it does not {_WAYS[settings.way_home]} when we are silent",
            ),
        )

    def fence(self, action: FenceAction, ceiling: float) -> dict[str, float]:
        """FENCE_ACTION: 0 report, 1 return or land, 2 land, 4 brake or land; all fence types."""
        code = {"warn": 0.0, "hold": 4.0, "return": 1.0, "land": 2.0}[action]
        altitude_and_polygon = 5.0
        return {
            "FENCE_ACTION": code,
            "FENCE_ALT_MAX": ceiling,
            "FENCE_TYPE": altitude_and_polygon,
            "FENCE_ENABLE": 1.0,
        }
