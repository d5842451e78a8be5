"""Faults of the vehicle by name: GPS, estimator, battery, vibration, sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["Health"]

_STANDS = 1.0
"""Seconds for which a fault must last before it is reported: estimators recover."""
_SILENT = 4.0
"""Seconds without the GPS' messages, sent twice a second, while other messages came."""
_GAP = 1.0
"""Longest counted gap between two messages in seconds: a longer one is the link's."""
_FIX = 3
"""GPS fix types from this one on are positions in space."""
_RTK = {
    mavlink.GPS_FIX_TYPE_RTK_FLOAT: "RTK float",
    mavlink.GPS_FIX_TYPE_RTK_FIXED: "RTK fixed",
}
_UNSURE = (100, 50, 20, 10, 5)
"""Step in metres in which a slowly growing fault is reported anew."""
_DOES_NOT_FIT = 0.8
"""Variance, of 1, from which ArduPilot rejects a sensor (its FS_EKF_THRESH)."""
_SHAKES = (60, 30)
"""Excessive vibration in m/s², and the level worth a report."""
_UNKNOWN = 65535
_UNKNOWN_SATELLITES = 255
_ENOUGH = 6
"""Satellites that both autopilots ask for (EKF2_REQ_NSATS; ArduPilot's EKF)."""
_HIGHEST_CELL = 4600
"""Millivolts that no cell has, at 4.35 V when it is full."""
_CLIPS = 10
"""Samples beyond an accelerometer's range from one message to the next."""

_HORIZONTAL = mavlink.ESTIMATOR_POS_HORIZ_REL | mavlink.ESTIMATOR_POS_HORIZ_ABS
_CHARGES = {
    mavlink.MAV_BATTERY_CHARGE_STATE_LOW: "low",
    mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL: "critical",
    mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY: "about to be empty",
    mavlink.MAV_BATTERY_CHARGE_STATE_FAILED: "failed",
    mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY: "unhealthy",
}
_BATTERY_FAULTS = {
    mavlink.MAV_BATTERY_FAULT_DEEP_DISCHARGE: "discharged too deeply",
    mavlink.MAV_BATTERY_FAULT_SPIKES: "its voltage jumps",
    mavlink.MAV_BATTERY_FAULT_CELL_FAIL: "a cell has failed",
    mavlink.MAV_BATTERY_FAULT_OVER_CURRENT: "too much current",
    mavlink.MAV_BATTERY_FAULT_OVER_TEMPERATURE: "too hot",
    mavlink.MAV_BATTERY_FAULT_UNDER_TEMPERATURE: "too cold",
    mavlink.MAV_BATTERY_FAULT_INCOMPATIBLE_VOLTAGE: "its voltage does not fit the vehicle",
}
_SENSORS = {
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO: "gyroscope",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO2: "second gyroscope",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL: "accelerometer",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL2: "second accelerometer",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG: "compass",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG2: "second compass",
    mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE: "barometer",
    mavlink.MAV_SYS_STATUS_SENSOR_GPS: "GPS",
    mavlink.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW: "optical flow",
    mavlink.MAV_SYS_STATUS_SENSOR_VISION_POSITION: "position by vision",
    mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION: "rangefinder",
    mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS: "motor outputs",
    mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER: "remote control",
    mavlink.MAV_SYS_STATUS_GEOFENCE: "its own geofence",
    mavlink.MAV_SYS_STATUS_AHRS: "attitude and heading",
    mavlink.MAV_SYS_STATUS_TERRAIN: "terrain data",
    mavlink.MAV_SYS_STATUS_LOGGING: "log",
    mavlink.MAV_SYS_STATUS_SENSOR_BATTERY: "battery",
    mavlink.MAV_SYS_STATUS_SENSOR_PROXIMITY: "proximity sensor",
    mavlink.MAV_SYS_STATUS_OBSTACLE_AVOIDANCE: "obstacle avoidance",
    mavlink.MAV_SYS_STATUS_SENSOR_PROPULSION: "propulsion",
}


class _Complaint(NamedTuple):
    since: float
    text: str


class Health:
    """Health monitor of one vehicle, updated by messages with their arrival times in seconds."""

    def __init__(self) -> None:
        self._complaints: dict[str, _Complaint] = {}
        self._fixed_at = -math.inf
        self._heard_at: float | None = None
        self._gps_silence = 0.0
        self._clipped: int | None = None
        self.cells: tuple[float, ...] | None = None
        """Volts of each cell of the first battery; None while they are not told."""
        self.cycles: int | None = None
        """Its charging cycles, likewise."""
        self.vibration: float | None = None
        """m/s² of the axis that shakes most."""
        self.compass: float | None = None
        self.estimator: float | None = None
        """Misfits as shares of what the estimator rejects: of the compass, and the largest of
        position, velocity and height (EKF_STATUS_REPORT: and compass)."""
        self.gps_fix: bool | None = None
        """Whether the GPS has a position in space."""
        self.gps_fix_type = 0
        """GPS_FIX_TYPE as last told; 0: no GPS."""
        self.satellites: int | None = None
        """Satellites that the GPS uses; None while they are not told."""
        self._charges_told = False
        """Batteries are reported by their own messages."""
        self._takers = {
            "GPS_RAW_INT": self._gps,
            "ESTIMATOR_STATUS": self._estimator,
            "EKF_STATUS_REPORT": self._filter,
            "BATTERY_STATUS": self._battery,
            "SMART_BATTERY_INFO": self._age,
            "VIBRATION": self._vibration,
            "SYS_STATUS": self._sensors,
        }

    @property
    def messages(self) -> frozenset[str]:
        """Names of the messages that it processes."""
        return frozenset(self._takers)

    def on_message(self, message: Any, now: float) -> None:  # noqa: ANN401 - pymavlink has no types
        """Process a message of any kind.

        Args:
            message: The message; of some kinds only its time counts.
            now: Monotonic clock, seconds.
        """
        if self._heard_at is not None:
            self._gps_silence += min(now - self._heard_at, _GAP)
        self._heard_at = now
        taker = self._takers.get(message.get_type())
        if taker is not None:
            taker(message, now)

    def faults(self, now: float) -> list[str]:
        """Faults at `now`, one sentence each, the name first."""
        told = [one.text for one in self._complaints.values() if now - one.since >= _STANDS]
        if math.isfinite(self._fixed_at) and self._gps_silence > _SILENT:
            told.insert(0, "GPS: it has fallen silent")
        return list(dict.fromkeys(told))

    def lost(self, now: float) -> bool:
        """Whether the estimator itself reports a lost position."""
        complaint = self._complaints.get("lost")
        return complaint is not None and now - complaint.since >= _STANDS

    @property
    def gps_objection(self) -> str:
        """Why the GPS gives no position that an autopilot flies by; empty if that is not told."""
        count, fixed = self.satellites, self.gps_fix_type >= _FIX
        if count is None or (fixed and count >= _ENOUGH):
            return ""
        words = f"GPS: {count} satellite{'' if count == 1 else 's'}, {_ENOUGH} are needed"
        return words if fixed else f"{words}; no fix"

    @property
    def gps_rtk(self) -> str:
        """How far its corrections have come; empty without any."""
        return _RTK.get(self.gps_fix_type, "")

    @property
    def sure_of_position(self) -> bool:
        """Whether the estimator and the GPS have no complaint about where it is."""
        return not any(name in self._complaints for name in ("fix", "unsure", "lost", "glitch"))

    def _set_fault(self, name: str, text: str, now: float) -> None:
        """Set the fault `name`, or clear it without a text."""
        if not text:
            self._complaints.pop(name, None)
            return
        before = self._complaints.get(name)
        self._complaints[name] = _Complaint(now if before is None else before.since, text)

    def _gps(self, message: Any, now: float) -> None:  # noqa: ANN401
        self._gps_silence = 0.0
        self.gps_fix = bool(message.fix_type >= _FIX)
        self.gps_fix_type = int(message.fix_type)
        told = message.satellites_visible != _UNKNOWN_SATELLITES
        self.satellites = int(message.satellites_visible) if told else None
        if message.fix_type >= _FIX:
            self._fixed_at = now
        # A vehicle that never had a fix flies without GPS, or reports the reason itself.
        lost = message.fix_type < _FIX and math.isfinite(self._fixed_at)
        kind = "a fix in the plane only" if message.fix_type == _FIX - 1 else "no fix"
        self._set_fault("fix", f"GPS: {kind}" if lost else "", now)

    def _estimator(self, message: Any, now: float) -> None:  # noqa: ANN401
        # PX4 sets the bit of a constant position when all is well, and clears it when it is lost.
        flags = message.flags & ~mavlink.ESTIMATOR_CONST_POS_MODE
        self._flags(flags, now, glitch=mavlink.ESTIMATOR_GPS_GLITCH)
        unsure = _step(message.pos_horiz_accuracy, _UNSURE)
        self._set_fault(
            "unsure", unsure and f"estimator: position unsure by more than {unsure} m", now
        )
        unsure = _step(message.pos_vert_accuracy, _UNSURE)
        self._set_fault(
            "height", unsure and f"estimator: height unsure by more than {unsure} m", now
        )
        self._fit({"compass": message.mag_ratio}, 1.0, now)
        places = (message.vel_ratio, message.pos_horiz_ratio, message.pos_vert_ratio)
        self.compass, self.estimator = _largest(message.mag_ratio), _largest(*places)

    def _filter(self, message: Any, now: float) -> None:  # noqa: ANN401
        self._flags(message.flags, now, glitch=mavlink.EKF_GPS_GLITCHING)
        misfits = {
            "position": message.pos_horiz_variance,
            "velocity": message.velocity_variance,
            "height": message.pos_vert_variance,
            "compass": message.compass_variance,
        }
        self._fit(misfits, _DOES_NOT_FIT, now)
        self.compass, self.estimator = (
            _largest(message.compass_variance),
            _largest(*misfits.values()),
        )

    def _flags(self, flags: int, now: float, *, glitch: int) -> None:
        """Process the bits that both kinds of status have in common."""
        lost = not flags & _HORIZONTAL or flags & mavlink.ESTIMATOR_CONST_POS_MODE
        self._set_fault("lost", "estimator: no position along the ground" if lost else "", now)
        jumps = "estimator: GPS positions jump, and are not believed"
        self._set_fault("glitch", jumps if flags & glitch else "", now)
        level = flags & mavlink.ESTIMATOR_ATTITUDE
        self._set_fault("attitude", "" if level else "estimator: attitude unknown", now)

    def _fit(self, misfits: dict[str, float], limit: float, now: float) -> None:
        for name, value in misfits.items():
            text = f"estimator: what is measured of its {name} does not fit"
            self._set_fault(f"misfit {name}", text if value > limit else "", now)

    def _age(self, message: Any, _: float) -> None:  # noqa: ANN401
        if message.id == 0 and message.cycle_count != _UNKNOWN:
            self.cycles = message.cycle_count

    def _battery(self, message: Any, now: float) -> None:  # noqa: ANN401
        name = f"battery {message.id + 1}" if message.id else "battery"
        self._charges_told |= message.charge_state != mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED
        if message.id == 0:
            self.cells = _cells([*message.voltages, *message.voltages_ext])
        said = [_CHARGES[message.charge_state]] if message.charge_state in _CHARGES else []
        said += [text for bit, text in _BATTERY_FAULTS.items() if message.fault_bitmask & bit]
        self._set_fault(name, f"{name}: {', '.join(said)}" if said else "", now)

    def _vibration(self, message: Any, now: float) -> None:  # noqa: ANN401
        shakes = _step(max(message.vibration_x, message.vibration_y, message.vibration_z), _SHAKES)
        self.vibration = _largest(message.vibration_x, message.vibration_y, message.vibration_z)
        text = shakes and f"vibration: more than {shakes} m/s²"
        self._set_fault("vibration", text, now)
        clipped = message.clipping_0 + message.clipping_1 + message.clipping_2
        more = 0 if self._clipped is None else clipped - self._clipped
        self._clipped = clipped
        clips = "vibration: beyond what the accelerometers measure"
        self._set_fault("clipping", clips if more > _CLIPS else "", now)

    def _sensors(self, message: Any, now: float) -> None:  # noqa: ANN401
        bad = (
            message.onboard_control_sensors_present
            & message.onboard_control_sensors_enabled
            & ~message.onboard_control_sensors_health
        )
        if self._charges_told:
            bad &= ~mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
        for bit, name in _SENSORS.items():
            self._set_fault(f"sensor {name}", f"{name}: unhealthy" if bad & bit else "", now)


def _largest(*values: float) -> float | None:
    """The largest of those that are numbers; None without any."""
    return max((one for one in values if math.isfinite(one)), default=None)


def _cells(millivolts: Sequence[int]) -> tuple[float, ...] | None:
    """Volts of each cell; None if they are not told.

    An autopilot that does not measure cells tells the whole battery's voltage as the first one.
    """
    told = [one for one in millivolts if 0 < one < _UNKNOWN]
    if not told or max(told) > _HIGHEST_CELL:
        return None
    return tuple(one / 1e3 for one in told)


def _step(value: float, steps: tuple[int, ...]) -> str:
    """The largest of `steps` that `value` exceeds, as text; empty if none, or no number."""
    return next((str(step) for step in steps if value > step), "")
