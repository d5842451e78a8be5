"""The emulated ArduCopter, with the habits that were seen in flight."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.vehicle import VehicleMode
from tools.mavlink_vehicle.firmware import Firmware, Result
from tools.mavlink_vehicle.flight import GuidedTarget, MavFlight
from tools.mavlink_vehicle.options import AutopilotOptions
from tools.mavlink_vehicle.store import ParameterStore

__all__ = ["EmulatedArduPilot"]

_OK, _FAILED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_FAILED
_STABILIZE, _GUIDED, _LOITER, _RETURN, _LAND, _BRAKE = 0, 4, 5, 6, 9, 17
_AUTO = 3
_MODES = {_STABILIZE, 2, _AUTO, _GUIDED, _LOITER, _RETURN, 7, _LAND, 16, _BRAKE}
_NEED_PLACE = {_GUIDED, _LOITER, _RETURN, _BRAKE}
_TIMEOUT = 3.0
"""GUID_TIMEOUT: seconds without setpoints after which it stops."""
_RETURNS = {1.0, 3.0, 6.0}
"""FS_GCS_ENABLE: return, straight, by the flown way or by a mission; all fly straight here."""
_LANDS_ON = 1 << 3
"""Bit of FS_OPTIONS."""
_CHECK = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_GPS = mavlink.MAV_SYS_STATUS_SENSOR_GPS
_POSITION = mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
_PRESENT, _ENABLED = 0x5371FC0F, 0x5361BC0F
"""SYS_STATUS' bits of what is always there, and of what is switched on without a position."""
_LEAST = 0.5
"""Metres of a take-off."""
_TELLS_AFTER = 1.2
"""Seconds after a breach of its fence at which it tells of it."""


class EmulatedArduPilot(Firmware):
    """Take-off above home in guided mode, nothing sent without a request, reasons as texts."""

    number: ClassVar[int] = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    default_rates: ClassVar[dict[int, float]] = {}
    unheard_of: ClassVar[frozenset[int]] = frozenset(
        {
            mavlink.MAVLINK_MSG_ID_ALTITUDE,
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
            mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION,
        }
    )
    wants_numbers: ClassVar[bool] = True
    interval_refused: ClassVar[int] = mavlink.MAV_RESULT_DENIED
    dead_reckoning: ClassVar[float] = 7.4
    version: ClassVar[int] = 0x04070000
    capabilities: ClassVar[int] = 0xFBEF

    def __init__(
        self, options: AutopilotOptions, flight: MavFlight, say: Callable[[Any], None]
    ) -> None:
        values = {
            "BATT_FS_LOW_ACT": 0.0,
            "FS_EKF_ACTION": 1.0,
            "FS_GCS_ENABLE": 0.0,
            "FS_GCS_TIMEOUT": 5.0,
            "FS_OPTIONS": 16.0,
            "RTL_ALT_M": 15.0,
            "RTL_ALT_FINAL_M": 0.0,
            "FENCE_ENABLE": 0.0,
            "FENCE_ACTION": 1.0,
            "FENCE_TYPE": 7.0,
            "FENCE_ALT_MAX": 100.0,
            "MAV_GCS_SYSID": 255.0,
            "MAV_GCS_SYSID_HI": 0.0,
        }
        super().__init__(options, flight, say, ParameterStore(values, set(), bytewise=False))
        self._mode = _STABILIZE
        self._station_at: float | None = None
        self._breached_at: float | None = None

    @property
    def custom_mode(self) -> int:
        """The mode's number."""
        return self._mode

    @property
    def guided(self) -> bool:
        """Guided."""
        return self._mode == _GUIDED

    def forget_mode(self) -> None:
        """Stabilize."""
        self._mode = _STABILIZE

    def hear_heartbeat(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        """HEARTBEAT of another system."""
        values = self.parameters.values
        lowest = values.get("MAV_GCS_SYSID", values.get("SYSID_MYGCS", 255.0))
        highest = values.get("MAV_GCS_SYSID_HI", 0.0)
        if lowest <= message.get_srcSystem() <= max(lowest, highest):
            self._station_at = self.now

    @property
    def sensors(self) -> tuple[int, int, int]:
        """GPS counts as healthy without a fix, too; the arming checks are listed as present."""
        seen = _GPS if self.ready else 0
        placed = _POSITION if self.knows_place else 0
        enabled = _ENABLED | seen | placed
        healthy = enabled & ~_CHECK | (_CHECK if self.ready else 0)
        return _PRESENT | seen, enabled, healthy

    def go_blind(self) -> None:
        """Land, by FS_EKF_ACTION."""
        self.text("EKF variance")
        self.text("EKF Failsafe: changed to LAND Mode")
        self._mode = _LAND
        self.failsafe = True
        self.motions.append("land")
        self.flight.land()

    def command(self, number: int, values: tuple[float, ...], frame: int | None) -> Result:
        """Modes and take-off."""
        if number == mavlink.MAV_CMD_DO_SET_MODE:
            return self._set_mode(int(values[1]))
        if number == mavlink.MAV_CMD_DO_REPOSITION and frame is not None:
            # It keeps its heading, whatever yaw is commanded.
            return self.go_to(math.nan, *values[4:]) if self.guided else _FAILED
        if number == mavlink.MAV_CMD_NAV_TAKEOFF:
            relative = {None, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT}
            fits = self.armed and self.guided and frame in relative
            if not fits or self.flight.flying or values[6] < _LEAST:
                return _FAILED
            self.lift(values[6])
            return _OK
        modes = {mavlink.MAV_CMD_NAV_LAND: _LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: _RETURN}
        if number in modes:
            return self._set_mode(modes[number])
        return mavlink.MAV_RESULT_UNSUPPORTED

    def _set_mode(self, mode: int) -> Result:
        if mode not in _MODES:
            return _FAILED
        if mode in _NEED_PLACE and not self.ready:
            self.text("Mode change failed: requires position")
            return _FAILED
        if mode == self._mode:
            return _OK
        if mode == _AUTO and not self.route.begin():
            return _FAILED
        self._mode = mode
        self.failsafe = False
        if mode != _AUTO:
            self.route.leave()
        deeds = {
            _RETURN: ("return", self.flight.return_home),
            _LAND: ("land", self.flight.land),
            _BRAKE: ("hold", self.flight.hold),
            _GUIDED: ("hold", self.flight.hold),
        }
        if mode in deeds and self.flight.flying:
            name, deed = deeds[mode]
            self.motions.append(name)
            deed()
        return _OK

    def take_over(self) -> None:
        """A pilot flips the switch: loiter."""
        self._mode = _LOITER
        self.route.leave()
        self.flight.hold()

    def enter_return(self) -> None:
        """Return to launch, by its own protection."""
        self._set_mode(_RETURN)
        self.failsafe = True

    def breach(self) -> None:
        """By FENCE_ACTION, if FENCE_ENABLE: 1 return, 2 land, 4 brake."""
        values = self.parameters.values
        if values["FENCE_ENABLE"] == 0.0:
            return
        mode = {1.0: _RETURN, 2.0: _LAND, 4.0: _BRAKE}.get(values["FENCE_ACTION"])
        if mode is not None:
            # A breach makes no state critical, and its text may come after the HEARTBEAT.
            self._set_mode(mode)
        self._breached_at = self.now

    def protect(self) -> None:
        """Stop when setpoints do; return when the ground station is lost."""
        if self._breached_at is not None and self.now - self._breached_at > _TELLS_AFTER:
            self._breached_at = None
            self.text("Polygon fence breached", mavlink.MAV_SEVERITY_NOTICE)
            outside = mavlink.FENCE_BREACH_BOUNDARY
            self._say(mavlink.MAVLink_fence_status_message(1, 1, outside, 0, 0))
        target = self.flight.target
        if self.guided and target is not None and self.now - self._setpoint_at > _TIMEOUT:
            if target.position is None:
                self.flight.hold()
            else:
                self.flight.target = GuidedTarget(target.position, None, target.yaw, None)
        values = self.parameters.values
        silence = math.inf if self._station_at is None else self.now - self._station_at
        lost = values["FS_GCS_TIMEOUT"] < silence < math.inf
        if not lost or values["FS_GCS_ENABLE"] == 0.0 or self.failsafe:
            return
        if self._mode == _LAND and int(values["FS_OPTIONS"]) & _LANDS_ON:
            return
        self.text("GCS Failsafe")
        if values["FS_GCS_ENABLE"] in _RETURNS:
            self.enter_return()
        else:
            self._set_mode(_LAND)
            self.failsafe = True

    def refuse_arming(self) -> None:
        """PreArm texts."""
        if not self.ready:
            self.text("PreArm: Need Position Estimate")
        if self.flight.mode is not VehicleMode.GROUNDED:
            self.text("Arm: not landed")
