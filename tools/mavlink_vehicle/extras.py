"""Telemetry beyond what our driver lives by, which ground stations and MAVSDK read."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.geometry.frames import enu_to_ned, yaw_enu_to_ned

if TYPE_CHECKING:
    from tools.mavlink_vehicle.firmware import Firmware

__all__ = ["Extras"]

_UNKNOWN_CELL = 65535
_NOT_GIVEN = -1
_RANGE = (20, 1200)
"""Centimetres that the rangefinder measures, as small lidars do."""
_ATTITUDE = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_VELOCITY_VERT
_HEIGHT = mavlink.ESTIMATOR_POS_VERT_ABS | mavlink.ESTIMATOR_POS_VERT_AGL
_HORIZONTAL = (
    mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_POS_HORIZ_REL
    | mavlink.ESTIMATOR_POS_HORIZ_ABS
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
)
"""EKF_STATUS_REPORT counts its flags in the same way."""


class Extras:
    """Makes messages out of what a firmware knows; what is not modelled is not sent."""

    def __init__(self, firmware: Firmware) -> None:
        self._firmware = firmware
        self._makers: dict[int, Callable[[], Any]] = {
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._quaternion,
            mavlink.MAVLINK_MSG_ID_ALTITUDE: self._altitude,
            mavlink.MAVLINK_MSG_ID_VFR_HUD: self._hud,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery,
            mavlink.MAVLINK_MSG_ID_VIBRATION: self._vibration,
            mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: self._distance,
        }
        px4 = firmware.number == mavlink.MAV_AUTOPILOT_PX4
        if px4:
            self._makers[mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS] = self._estimator
        else:
            self._makers[mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT] = self._ekf
            del self._makers[mavlink.MAVLINK_MSG_ID_ALTITUDE]

    def message(self, number: int) -> Any | None:  # noqa: ANN401 - pymavlink has no types
        """The message of that number; None if it is not modelled."""
        maker = self._makers.get(number)
        return None if maker is None else maker()

    @property
    def _stamp(self) -> int:
        return int(self._firmware.now * 1e3)

    def _quaternion(self) -> Any:  # noqa: ANN401
        seen = self._firmware.flight.believed
        roll, pitch, yaw = seen.roll / 2, -seen.pitch / 2, yaw_enu_to_ned(seen.yaw) / 2
        sines = [math.sin(angle) for angle in (roll, pitch, yaw)]
        cosines = [math.cos(angle) for angle in (roll, pitch, yaw)]
        (sr, sp, sy), (cr, cp, cy) = sines, cosines
        return mavlink.MAVLink_attitude_quaternion_message(
            self._stamp,
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            *(0.0, 0.0, -seen.yaw_rate),
        )

    def _altitude(self) -> Any:  # noqa: ANN401
        firmware = self._firmware
        up = -float(firmware.flight.ned[2])
        over_home = up + float(firmware.home[2])
        above_sea = firmware.flight.altitude
        return mavlink.MAVLink_altitude_message(
            self._stamp * 1000, above_sea, above_sea, up, over_home, math.nan, math.nan
        )

    def _hud(self) -> Any:  # noqa: ANN401
        firmware, seen = self._firmware, self._firmware.flight.believed
        north, east, down = enu_to_ned(seen.velocity)
        heading = round(math.degrees(yaw_enu_to_ned(seen.yaw))) % 360
        throttle = 50 if firmware.flight.flying else 0
        return mavlink.MAVLink_vfr_hud_message(
            0.0, math.hypot(north, east), heading, throttle, firmware.flight.altitude, -down
        )

    def _battery(self) -> Any:  # noqa: ANN401
        flight = self._firmware.flight
        cells = [round(1e3 * flight.voltage), *[_UNKNOWN_CELL] * 9]
        left = round(100 * flight.charge)
        return mavlink.MAVLink_battery_status_message(
            0, 1, 1, 32767, cells, _NOT_GIVEN, _NOT_GIVEN, _NOT_GIVEN, left, 0, self._charge(left)
        )

    @staticmethod
    def _charge(left: int) -> int:
        """The charge state at that many per cent: PX4's thresholds as delivered."""
        states: dict[int, int] = {
            5: mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY,
            7: mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL,
            15: mavlink.MAV_BATTERY_CHARGE_STATE_LOW,
        }
        found: list[int] = [state for most, state in states.items() if left <= most]
        ok: int = mavlink.MAV_BATTERY_CHARGE_STATE_OK
        return found[0] if found else ok

    def _distance(self) -> Any | None:  # noqa: ANN401
        slope = self._firmware.options.rangefinder
        if slope is None:
            return None
        seen = self._firmware.flight.believed
        east, _, up = seen.position
        above = max(0.0, float(up) - slope * max(0.0, float(east)))
        read = round(100 * above / (math.cos(seen.roll) * math.cos(seen.pitch)))
        nearest, farthest = _RANGE
        return mavlink.MAVLink_distance_sensor_message(
            self._stamp,
            *(nearest, farthest, min(max(read, nearest - 1), farthest + 1)),
            mavlink.MAV_DISTANCE_SENSOR_LASER,
            0,
            mavlink.MAV_SENSOR_ROTATION_PITCH_270,
            255,
        )

    def _vibration(self) -> Any:  # noqa: ANN401
        return mavlink.MAVLink_vibration_message(self._stamp * 1000, 0.01, 0.01, 0.1, 0, 0, 0)

    def _flags(self) -> int:
        firmware = self._firmware
        flags: int = _ATTITUDE | _HEIGHT | (_HORIZONTAL if firmware.knows_place else 0)
        still = firmware.stands_still and not firmware.flight.flying
        held: int = mavlink.ESTIMATOR_CONST_POS_MODE if still else 0
        return flags | held

    def _estimator(self) -> Any:  # noqa: ANN401
        unsure = self._firmware.unsure
        fits = 0.05 if self._firmware.knows_place else math.nan
        return mavlink.MAVLink_estimator_status_message(
            self._stamp * 1000, self._flags(), fits, fits, fits, 0.05, 0.0, 0.0, unsure, 0.5
        )

    def _ekf(self) -> Any:  # noqa: ANN401
        across = 0.05 if self._firmware.knows_place else 1.0
        return mavlink.MAVLink_ekf_status_report_message(
            self._flags(), across, across, 0.05, 0.05, 0.0
        )
