"""The emulated PX4, with the habits that were seen in flight."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

from aerodaas.drivers.mavlink.microservices.events import event_number
from aerodaas.drivers.mavlink.wire.dialect import EventMessage, mavlink
from tools.mavlink_vehicle.firmware import Firmware, Result
from tools.mavlink_vehicle.flight import MavFlight
from tools.mavlink_vehicle.options import AutopilotOptions
from tools.mavlink_vehicle.store import ParameterStore

__all__ = ["EmulatedPX4"]

_OK, _LATER = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
_ALTITUDE, _POSITION, _AUTO, _OFFBOARD, _TERMINATION = 2, 3, 4, 6, 10
_TAKE_OFF, _HOLD, _MISSION, _RETURN, _LAND = 2, 3, 4, 5, 6
_NEAR = 0.7
"""Metres below its altitude at which a take-off counts as done, about NAV_MC_ALT_RAD."""
_CHECK = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_GPS = mavlink.MAV_SYS_STATUS_SENSOR_GPS
_POSITION_CONTROL = mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
_PRESENT = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    | mavlink.MAV_SYS_STATUS_LOGGING
    | _POSITION_CONTROL
)
_HEALTHY = (
    (_PRESENT & ~_POSITION_CONTROL)
    | mavlink.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_ATTITUDE_STABILIZATION
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_AHRS
    | _GPS
)
"""What complains is unhealthy; what there is not does not complain."""
_SPOOL_UP = 1.0
"""COM_SPOOLUP_TIME: seconds from arming until it lifts."""
_LOW = 0.15
"""BAT_LOW_THR."""
_RETURN_ACTION, _HOLD_ACTION = 3.0, 5.0


class EmulatedPX4(Firmware):
    """Take-off above the sea, offboard that must be fed, reasons as events."""

    number: ClassVar[int] = mavlink.MAV_AUTOPILOT_PX4
    arming_refused: ClassVar[int] = _LATER
    disarming_refused: ClassVar[int] = _LATER
    unheard_of: ClassVar[frozenset[int]] = frozenset(
        {mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, mavlink.MAVLINK_MSG_ID_SIM_STATE}
    )
    starting: ClassVar[int] = mavlink.MAV_STATE_UNINIT
    stands_still: ClassVar[bool] = True
    no_fix: ClassVar[int] = mavlink.GPS_FIX_TYPE_NO_GPS
    dead_reckoning: ClassVar[float] = 5.0
    version: ClassVar[int] = 0x011001FF
    capabilities: ClassVar[int] = 0xE8FF
    default_rates: ClassVar[dict[int, float]] = {
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 30.0,
        mavlink.MAVLINK_MSG_ID_ATTITUDE: 50.0,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 2.0,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
        mavlink.MAVLINK_MSG_ID_ALTITUDE: 1.0,
        mavlink.MAVLINK_MSG_ID_VFR_HUD: 1.0,
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 1.0,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
        mavlink.MAVLINK_MSG_ID_VIBRATION: 0.5,
    }

    def __init__(
        self, options: AutopilotOptions, flight: MavFlight, say: Callable[[Any], None]
    ) -> None:
        values = {
            "COM_LOW_BAT_ACT": 0.0,
            "COM_OBL_RC_ACT": 0.0,
            "NAV_DLL_ACT": 0.0,
            "GF_ACTION": 2.0,
            "GF_MAX_VER_DIST": 0.0,
            "MIS_TAKEOFF_ALT": 2.5,
            "RTL_RETURN_ALT": 30.0,
            "RTL_LAND_DELAY": 0.0,
            "COM_OF_LOSS_T": 1.0,
        }
        integers = {"COM_LOW_BAT_ACT", "COM_OBL_RC_ACT", "NAV_DLL_ACT", "GF_ACTION"}
        super().__init__(options, flight, say, ParameterStore(values, integers, bytewise=True))
        self._main, self._sub = _AUTO, _HOLD
        self._altitude = math.nan
        self._sequence = 0

    @property
    def custom_mode(self) -> int:
        """Main mode in the third byte, sub mode in the fourth."""
        return self._main << 16 | self._sub << 24

    @property
    def guided(self) -> bool:
        """Offboard."""
        return self._main == _OFFBOARD

    def forget_mode(self) -> None:
        """Hold."""
        self._main, self._sub = _AUTO, _HOLD

    @property
    def sensors(self) -> tuple[int, int, int]:
        """The arming checks are never listed as present: only whether they pass is told."""
        present = _PRESENT | (_GPS if self.knows_place else 0)
        healthy = _HEALTHY | (_POSITION_CONTROL if self.knows_place else 0)
        healthy |= _CHECK if self.may_arm() else 0
        if self.flight.charge <= _LOW:
            healthy &= ~mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
        return present, present | mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER, healthy

    @property
    def sinks_blind(self) -> bool:
        """Shown as altitude mode, or as position mode without a pilot at the sticks."""
        return self._main == _ALTITUDE or (self._main == _POSITION and self.failsafe)

    def go_blind(self) -> None:
        """Shown as altitude mode; it sinks where it drifts."""
        self._main, self._sub = _ALTITUDE, 0
        self.failsafe = True
        self.flight.land()

    def may_arm(self) -> bool:
        """Not in offboard without setpoints, though that mode itself was accepted."""
        return self.knows_place and not self.terminated and (not self.guided or self._fed)

    @property
    def _fed(self) -> bool:
        """Whether the last setpoint is young enough for offboard."""
        return self.now - self._setpoint_at <= self.parameters.values["COM_OF_LOSS_T"]

    def command(  # noqa: PLR0911 - one for each command
        self, number: int, values: tuple[float, ...], frame: int | None
    ) -> Result:
        """Modes and take-off."""
        if number == mavlink.MAV_CMD_DO_SET_MODE:
            return self._set_mode(int(values[1]), int(values[2]))
        if number == mavlink.MAV_CMD_DO_FLIGHTTERMINATION and values[0] == 1.0:
            self._main, self._sub = _TERMINATION, 0
            return self.terminate()
        if number == mavlink.MAV_CMD_DO_REPOSITION and frame is not None:
            result = self._set_mode(_AUTO, _HOLD)
            return self.go_to(*values[3:]) if result == _OK else result
        if number == mavlink.MAV_CMD_NAV_TAKEOFF:
            if frame not in {None, mavlink.MAV_FRAME_GLOBAL}:
                return mavlink.MAV_RESULT_DENIED
            default = self.flight.altitude + self.parameters.values["MIS_TAKEOFF_ALT"]
            self._altitude = values[6] if math.isfinite(values[6]) else default
            return self._set_mode(_AUTO, _TAKE_OFF)
        sub = {mavlink.MAV_CMD_NAV_LAND: _LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: _RETURN}
        if number in sub:
            return self._set_mode(_AUTO, sub[number])
        return mavlink.MAV_RESULT_UNSUPPORTED

    def _set_mode(self, main: int, sub: int) -> Result:
        if main == _AUTO and not self.knows_place:
            self._event("commander_modeswitch_not_avail", mavlink.MAV_SEVERITY_CRITICAL)
            return _LATER
        if (main, sub) == (self._main, self._sub):
            return _OK
        if (main, sub) == (_AUTO, _MISSION) and not self.route.begin():
            return mavlink.MAV_RESULT_DENIED
        self._main, self._sub = main, sub
        self.failsafe = False
        if (main, sub) != (_AUTO, _MISSION):
            self.route.leave()
        if main == _AUTO and self.flight.flying:
            deeds = {_HOLD: self.flight.hold, _RETURN: self.flight.return_home}
            deeds[_LAND] = self.flight.land
            if sub in deeds:
                self.motions.append({_HOLD: "hold", _RETURN: "return", _LAND: "land"}[sub])
                deeds[sub]()
        return _OK

    def take_over(self) -> None:
        """A pilot moves the sticks: position mode."""
        self._main, self._sub = _POSITION, 0
        self.route.leave()
        self.flight.hold()

    def enter_return(self) -> None:
        """Return to launch, by its own protection."""
        self._set_mode(_AUTO, _RETURN)
        self.failsafe = True

    def breach(self) -> None:
        """By GF_ACTION: 2 hold, 3 return, 5 land."""
        sub = {2.0: _HOLD, 3.0: _RETURN, 5.0: _LAND}.get(self.parameters.values["GF_ACTION"])
        self._event("commander_failsafe_enter_generic", mavlink.MAV_SEVERITY_CRITICAL)
        self._event("commander_arming_check_summary", 8)
        self._event("check_gf_violation_custom_gf", mavlink.MAV_SEVERITY_CRITICAL)
        self._event("commander_health_summary", 8)
        if sub is not None:
            self._set_mode(_AUTO, sub)
            self.failsafe = True

    def protect(self) -> None:
        """Lift once armed for take-off; leave offboard when setpoints stop."""
        taking_off = (self._main, self._sub) == (_AUTO, _TAKE_OFF)
        if taking_off and not self._lifted:
            if self.now - self._armed_at > _SPOOL_UP:
                self.lift(max(0.5, self.flight.rise_to(self._altitude)))
        elif taking_off and self.flight.rise_to(self._altitude) < _NEAR:
            self._sub = _HOLD
            self.flight.hold()
        if self.guided and self.flight.flying and not self._fed:
            action = self.parameters.values["COM_OBL_RC_ACT"]
            sub = {_RETURN_ACTION: _RETURN, _HOLD_ACTION: _HOLD}.get(action)
            self._event("commander_failsafe_enter_generic", mavlink.MAV_SEVERITY_CRITICAL)
            if sub is None:
                # Position mode, by sticks without a pilot: it sinks where it is.
                self._main, self._sub = _POSITION, 0
                self.flight.land()
            else:
                self._set_mode(_AUTO, sub)
            self.failsafe = True

    def refuse_arming(self) -> None:
        """The report of the arming checks, as events."""
        self._event("commander_arming_check_summary", 8)
        if not self.ready:
            self._event("check_estimator_hor_pos_not_stable", mavlink.MAV_SEVERITY_ERROR)
        if not self.may_arm() and self.guided:
            self._event("check_modes_offboard_signal", mavlink.MAV_SEVERITY_ERROR)
        self._event("commander_health_summary", 8)

    def _event(self, name: str, severity: int) -> None:
        self._sequence = (self._sequence + 1) % 0x10000
        boot = int(self.now * 1e3)
        arguments = [0] * 40
        levels = severity | severity << 4
        self._say(EventMessage(0, 0, event_number(name), boot, self._sequence, levels, arguments))
