"""PX4's events: what it says instead of STATUSTEXT.

An event's number is a hash of its name (`events::ID` of PX4: 24 bits of 32-bit FNV-1a below the
component's number). The names say enough for a person; the full texts lie in a file on the
autopilot whose version they belong to.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["EventReader", "Said", "event_number"]

_CHECKS = """
above_wind_limits_warning accel_missing accel_no_data accel_not_calibrated airspeed_invalid
airspeed_no_data airspeed_too_high armable_configuration avionics_power_high avionics_power_low
avionics_power_missing avionics_power_redundancy baro_missing baro_no_data battery_critical
battery_disconnected battery_emergency battery_fault battery_low battery_missing
battery_rem_flight_time_low battery_unhealthy cpuload_too_high distance_sensor_invalid
distance_sensor_missing escs_not_all_armed escs_offline escs_telem_missing
estimator_gnss_fault estimator_gnss_fusion_stopped estimator_gps_fix_too_low
estimator_gps_generic estimator_gps_hor_pos_drift_too_high estimator_gps_hor_pos_err_too_high
estimator_gps_hor_speed_drift_too_high estimator_gps_jammed estimator_gps_not_fusing
estimator_gps_num_sats_too_low estimator_gps_pdop_too_high estimator_gps_speed_acc_too_low
estimator_gps_spoofed estimator_gps_vert_pos_drift_too_high estimator_gps_vert_pos_err_too_high
estimator_gps_vert_speed_drift_too_high estimator_heading_not_stable estimator_hgt_not_stable
estimator_high_accel_bias estimator_high_gyro_bias estimator_hor_pos_not_stable
estimator_hor_vel_not_stable estimator_low_position_accuracy estimator_mag_fault
estimator_mag_interference estimator_missing_data estimator_position_failure_imminent
estimator_vert_vel_not_stable external_modes_unavailable external_modes_unresponsive
failure_detector_alt failure_detector_arm_esc failure_detector_ext
failure_detector_imbalanced_prop failure_detector_pitch failure_detector_roll flight_time_limit
gf_no_home gf_violation_custom_gf gf_violation_max_alt gf_violation_max_hor_dist gyro_missing
gyro_no_data gyro_not_calibrated hardfault_present high_wind_warning imu_accel_inconsistent
imu_gyro_inconsistent mag_consistency mag_fault mag_missing mag_no_data mag_not_calibrated
mag_sys_has_mag_missing man_control_kill_engaged man_control_landing_gear_up
man_control_rtl_engaged missing_cpuload missing_fmu_sdcard missing_system_power mission_failure
modes_angular_velocity modes_attitude modes_cannot_takeoff modes_global_pos modes_home_position
modes_local_alt modes_local_pos modes_manual_control modes_mission modes_offboard_signal
motor_overcurrent motor_undercurrent navigator_failure_hagl optical_flow_sensor_invalid
optical_sensor_missing parachute_missing parachute_unhealthy power_oc_hipower power_oc_periph
power_oc_report ram_usage_too_high rc_dl_no_dllink rc_max_too_high rc_min_too_small
rc_trim_too_high rc_trim_too_small system_arm_auth_failed system_flight_term_active
system_no_global_pos system_no_home_pos system_safety_button system_usb_connected
task_watchdog_present wind_too_high
"""
_COMMANDER = """
arm_denied_calibrating arm_denied_not_manual arm_denied_resolve_failures arm_denied_throttle_center
arm_denied_throttle_high disarm_denied_not_landed failsafe_enter failsafe_enter_autopilot_disengaged
failsafe_enter_crit_bat_warn failsafe_enter_crit_low_bat_warn failsafe_enter_generic
failsafe_enter_generic_hold failsafe_enter_generic_warn failsafe_enter_hold
failsafe_enter_low_bat failsafe_enter_low_flight_time_warn gcs_lost kill_sw_engaged
max_flight_time_warning_seconds mission_start_denied_no_mission modeswitch_not_avail rc_lost
rc_override rtl unsupported_auto_mode unsupported_base_mode unsupported_main_mode
"""


def event_number(name: str) -> int:
    """The number of the autopilot's event called `name`."""
    digest = 0x811C9DC5
    for letter in name.encode():
        digest = (digest ^ letter) * 0x01000193 & 0xFFFFFFFF
    return 1 << 24 | digest & 0xFFFFFF


_TEXTS = {
    **{event_number(f"check_{name}"): name.replace("_", " ") for name in _CHECKS.split()},
    **{event_number(f"commander_{name}"): name.replace("_", " ") for name in _COMMANDER.split()},
}
_BEGIN = event_number("commander_arming_check_summary")
_END = event_number("commander_health_summary")
_HARMLESS = 5
"""Log level of a notice; larger ones are information, or for the protocol only."""


class Said(NamedTuple):
    """What an event says, and its severity as in STATUSTEXT."""

    text: str
    severity: int


class EventReader:
    """Reads events, and gathers those of each report of the arming checks."""

    def __init__(self) -> None:
        self.objections: tuple[str, ...] = ()
        """What the latest whole report of the arming checks complains about."""
        self._report: list[str] | None = None
        self._latest: int | None = None

    def take(self, number: int, log_levels: int, sequence: int, now: float) -> Said | None:
        """Take one event; None for one that is a repetition or nobody needs to know."""
        del now
        if sequence == self._latest:
            return None
        self._latest = sequence
        if number == _BEGIN:
            self._report = []
            return None
        if number == _END:
            self.objections = tuple(dict.fromkeys(self._report or ()))
            self._report = None
            return None
        severity = log_levels & 0x0F
        if severity >= _HARMLESS:
            return None
        text = _TEXTS.get(number, f"event {number:#010x}")
        if self._report is not None:
            self._report.append(text)
        return Said(text, severity)
