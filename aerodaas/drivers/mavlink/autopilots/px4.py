"""PX4: offboard, modes by main and sub mode, take-off to an altitude above the sea."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import ClassVar

from aerodaas.drivers.mavlink.autopilots.autopilot import (
    ANYWHERE,
    NOT_GIVEN,
    Autopilot,
    Failsafe,
    FallbackParameter,
    FenceAction,
    older_than,
    return_height,
)
from aerodaas.drivers.mavlink.microservices.commander import PendingCommand
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["PX4"]

_AUTO, _OFFBOARD = 4, 6
_MAIN = {
    1: "manual",
    2: "altitude",
    3: "position",
    5: "acro",
    _OFFBOARD: "offboard",
    7: "stabilized",
}
_SUB = {
    1: "ready",
    2: "take-off",
    3: "hold",
    4: "mission",
    5: "return",
    6: "land",
    8: "follow",
    9: "precision landing",
}
_MODES = {
    FlightMode.GUIDED: (_OFFBOARD, 0),
    FlightMode.TAKE_OFF: (_AUTO, 2),
    FlightMode.HOLD: (_AUTO, 3),
    FlightMode.MISSION: (_AUTO, 4),
    FlightMode.RETURN: (_AUTO, 5),
    FlightMode.LAND: (_AUTO, 6),
}
_KNOWN = {mode: ours for ours, mode in _MODES.items()}
_RETURN, _HOLD = 3.0, 5.0
"""Values of COM_OBL_RC_ACT."""
_RETURN_ALONE = 2.0
"""Value of NAV_DLL_ACT, and of COM_OBL_ACT, which versions before 1.14 heed without a radio."""
_INTEGER = {
    mavlink.MAV_PARAM_TYPE_UINT8,
    mavlink.MAV_PARAM_TYPE_INT8,
    mavlink.MAV_PARAM_TYPE_UINT16,
    mavlink.MAV_PARAM_TYPE_INT16,
    mavlink.MAV_PARAM_TYPE_UINT32,
    mavlink.MAV_PARAM_TYPE_INT32,
}


class PX4(Autopilot):
    """PX4 1.13 and later (flown: 1.16, and its development version of March 2026)."""

    name: ClassVar[str] = "PX4"
    family: ClassVar[int] = mavlink.MAV_AUTOPILOT_PX4
    stream_before: ClassVar[float] = 1.2
    stops_short: ClassVar[float] = 1.2
    home_comes_first: ClassVar[bool] = False
    turns_at_waypoints: ClassVar[bool] = True
    rates: ClassVar[dict[int, float]] = {
        **Autopilot.rates,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 2.0,
    }
    alone: ClassVar[str] = (
        "PX4 leaves offboard mode within 1.3 s and does what COM_OBL_RC_ACT says: by default, and "
        "without a radio, it sinks where it is; since 2026 it does what NAV_RCL_ACT says instead"
    )
    comes_home: ClassVar[str] = "PX4 leaves offboard mode within a second or so, and comes home"
    ways_home: ClassVar[frozenset[str]] = frozenset({"return"})
    failsafes: ClassVar[tuple[Failsafe, ...]] = (
        Failsafe(
            "COM_LOW_BAT_ACT",
            frozenset({0.0, 1.0}),
            3.0,
            "a low battery only leads to a warning",
        ),
    )

    def mode(self, custom_mode: int) -> FlightMode:
        """The flight mode of a HEARTBEAT."""
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        return _KNOWN.get((main, sub if main == _AUTO else 0), FlightMode.OTHER)

    def mode_name(self, custom_mode: int) -> str:
        """The mode's usual name."""
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        names, number = (_SUB, sub) if main == _AUTO else (_MAIN, main)
        return names.get(number, f"mode {main}/{sub}")

    def ask_mode(self, mode: FlightMode) -> PendingCommand:
        """Command one of its modes."""
        main, sub = _MODES[mode]
        values = (1.0, float(main), float(sub), 0.0, 0.0, 0.0, 0.0)
        return PendingCommand(mavlink.MAV_CMD_DO_SET_MODE, values, f"mode {mode.value}", mode=mode)

    def take_off(self, height: float, telemetry: Telemetry) -> tuple[PendingCommand, ...]:
        """From hold, where no sticks are needed: arm, then climb to an altitude above the sea."""
        altitude = (telemetry.altitude or 0.0) + height
        climb = PendingCommand(
            mavlink.MAV_CMD_NAV_TAKEOFF,
            (NOT_GIVEN, 0.0, 0.0, NOT_GIVEN, ANYWHERE, ANYWHERE, altitude),
            "take off",
            mavlink.MAV_FRAME_GLOBAL,
            FlightMode.TAKE_OFF,
        )
        return self.ask_mode(FlightMode.HOLD), self.arm(), climb

    def ready(self, telemetry: Telemetry) -> bool | None:
        """It has the bit in `health` only; before it has looked, nothing is present."""
        if telemetry.sensors is None or not telemetry.sensors.present:
            return None
        return bool(telemetry.sensors.health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)

    def objections(self, telemetry: Telemetry, now: float) -> list[str]:
        """Complaints of its latest report of the arming checks."""
        del now
        if telemetry.altitude is None:
            unknown = "PX4 does not know its altitude above the sea yet"
            return [*telemetry.events.objections_to_hold, unknown]
        ready, events = self.ready(telemetry), telemetry.events
        if ready is None:
            return ["PX4 has not told yet whether its arming checks pass"]
        if ready:
            return []
        if self.mode(telemetry.custom_mode) is not FlightMode.HOLD and events.objections:
            # A take-off begins with hold, so that what only its present mode lacks does not matter.
            return list(events.objections_to_hold)
        # It reports what other modes lack as well: no matter while there is anything else.
        found = events.objections_to_hold or events.objections
        return list(found) or ["PX4's arming checks fail"]

    def protection_reasons(self, telemetry: Telemetry, now: float, seconds: float) -> list[str]:
        """New findings of its checks in flight, and texts of its events.

        Args:
            telemetry: What the vehicle has told so far.
            now: Monotonic clock, seconds.
            seconds: Age up to which findings and texts count.
        """
        said = telemetry.texts.recent(now, seconds)
        return [*telemetry.events.new_objections(now, seconds), *said]

    def encode(self, value: float, kind: int) -> float:
        """Integers travel as the float of the same bytes."""
        if kind not in _INTEGER:
            return value
        (encoded,) = struct.unpack("<f", struct.pack("<i", round(value)))
        return float(encoded)

    def decode(self, value: float, kind: int) -> float:
        """Integers travel as the float of the same bytes."""
        if kind not in _INTEGER:
            return value
        (decoded,) = struct.unpack("<i", struct.pack("<f", value))
        return float(decoded)

    def fallback(
        self, settings: MavlinkSettings, ceiling: float, software: str
    ) -> tuple[FallbackParameter, ...]:
        """Parameters for when setpoints stop, or its ground station, which we may be, is silent.

        A ground station's vehicle holds first and returns after the 10 s by which PX4 calls the
        ground station lost, so that a moment without a link sends it nowhere; a companion's
        returns at once, and follows setpoints again when they come (failsafe.cpp). Before 1.14 it
        asks another parameter while it has no radio.

        Args:
            settings: Our role, and when and how it is to come home.
            ceiling: Ceiling of the geofence, metres above home.
            software: Version of the autopilot; empty where it is not known.
        """
        after = settings.fallback_after
        sinks = "when our setpoints stop it may sink where it is, wait for a pilot, or hover"
        acts = FallbackParameter(("COM_OBL_RC_ACT",), lambda v: v == _RETURN, _RETURN, sinks)
        if settings.role == "ground_station":
            acts = FallbackParameter(
                ("COM_OBL_RC_ACT",), lambda v: v in {_RETURN, _HOLD}, _HOLD, sinks
            )
        wanted = [
            FallbackParameter(
                ("COM_OF_LOSS_T",),
                lambda value: value <= after,
                1.0,
                f"it acts later than {after:g} s after our last setpoint",
            ),
            return_height(ceiling, "RTL_RETURN_ALT"),
            FallbackParameter(
                ("RTL_LAND_DELAY",),
                lambda value: value >= 0.0,
                0.0,
                "it would hover over its home instead of landing",
            ),
            acts,
        ]
        returns = FallbackParameter((), lambda value: value == _RETURN_ALONE, _RETURN_ALONE, sinks)
        if older_than(software, 1, 14):
            wanted.append(replace(returns, names=("COM_OBL_ACT",)))
        if settings.role == "ground_station":
            lost = "the loss of the ground station is ignored"
            wanted.append(replace(returns, names=("NAV_DLL_ACT",), why=lost))
        return tuple(wanted)

    def fence(self, action: FenceAction, ceiling: float) -> dict[str, float]:
        """GF_ACTION: 1 warn, 2 hold, 3 return, 5 land."""
        code = {"warn": 1.0, "hold": 2.0, "return": 3.0, "land": 5.0}[action]
        return {"GF_ACTION": code, "GF_MAX_VER_DIST": ceiling}
