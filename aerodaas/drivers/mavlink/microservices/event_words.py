"""Texts of PX4's events, by the event's name without its component's."""

from __future__ import annotations

__all__ = ["CAUSES", "CHECKS", "COMMANDER"]

_CHECKS = """
above_wind_limits_warning: wind: stronger than allowed
accel_missing: accelerometer: missing
accel_no_data: accelerometer: no data
accel_not_calibrated: accelerometer: not calibrated
airspeed_invalid: airspeed: not valid
airspeed_no_data: airspeed: no data
airspeed_too_high: airspeed: too high to arm
armable_configuration: its configuration does not allow to arm
avionics_power_high: avionics' voltage: too high
avionics_power_low: avionics' voltage: too low
avionics_power_missing: avionics' voltage: unknown
avionics_power_redundancy: avionics' voltage: a supply is missing
baro_missing: barometer: missing
baro_no_data: barometer: no data
battery_critical: battery: critical
battery_disconnected: battery: disconnected
battery_emergency: battery: about to be empty
battery_fault: battery: a fault
battery_low: battery: low
battery_missing: battery: missing
battery_rem_flight_time_low: battery: little time of flight is left
battery_unhealthy: battery: unhealthy
cpuload_too_high: autopilot: its processor is too busy
distance_sensor_invalid: rangefinder: not valid
distance_sensor_missing: rangefinder: missing
escs_not_all_armed: motor controllers: not all are armed
escs_offline: motor controllers: offline
escs_telem_missing: motor controllers: no telemetry
estimator_gnss_fault: estimator: the GPS is at fault
estimator_gnss_fusion_stopped: estimator: uses the GPS no more
estimator_gps_fix_too_low: GPS: no fix
estimator_gps_generic: GPS: not good enough
estimator_gps_hor_pos_drift_too_high: GPS: its position drifts
estimator_gps_hor_pos_err_too_high: GPS: its position is too unsure
estimator_gps_hor_speed_drift_too_high: GPS: its speed drifts
estimator_gps_jammed: GPS: jammed
estimator_gps_not_fusing: estimator: does not use the GPS
estimator_gps_num_sats_too_low: GPS: too few satellites
estimator_gps_pdop_too_high: GPS: the satellites stand badly
estimator_gps_speed_acc_too_low: GPS: its speed is too unsure
estimator_gps_spoofed: GPS: somebody may be faking it
estimator_gps_vert_pos_drift_too_high: GPS: its height drifts
estimator_gps_vert_pos_err_too_high: GPS: its height is too unsure
estimator_gps_vert_speed_drift_too_high: GPS: its climb drifts
estimator_heading_not_stable: estimator: heading not stable
estimator_hgt_not_stable: estimator: height not stable
estimator_high_accel_bias: estimator: the accelerometer is far off
estimator_high_gyro_bias: estimator: the gyroscope is far off
estimator_hor_pos_not_stable: estimator: position not stable
estimator_hor_vel_not_stable: estimator: velocity not stable
estimator_low_position_accuracy: estimator: position too unsure
estimator_mag_fault: compass: at fault
estimator_mag_interference: compass: disturbed by something magnetic
estimator_missing_data: estimator: no data
estimator_position_failure_imminent: estimator: its position is about to be lost
estimator_vert_vel_not_stable: estimator: climb not stable
external_modes_unavailable: a mode from outside is not available
external_modes_unresponsive: a mode from outside does not answer
failure_detector_alt: it does not hold its height
failure_detector_arm_esc: motor controllers: one does not start
failure_detector_ext: an outside failure detector has spoken
failure_detector_imbalanced_prop: a propeller is out of balance
failure_detector_pitch: it is pitched too far
failure_detector_roll: it is rolled too far
flight_time_limit: the longest time of flight is over
gf_no_home: its own geofence: no home position
gf_violation_custom_gf: its own geofence: outside
gf_violation_max_alt: its own geofence: too high
gf_violation_max_hor_dist: its own geofence: too far away
gyro_missing: gyroscope: missing
gyro_no_data: gyroscope: no data
gyro_not_calibrated: gyroscope: not calibrated
hardfault_present: autopilot: it has crashed before; see its log
high_wind_warning: wind: strong
imu_accel_inconsistent: accelerometers: they disagree
imu_gyro_inconsistent: gyroscopes: they disagree
mag_consistency: compasses: they disagree
mag_fault: compass: at fault
mag_missing: compass: missing
mag_no_data: compass: no data
mag_not_calibrated: compass: not calibrated
mag_sys_has_mag_missing: compass: fewer than configured
man_control_kill_engaged: the kill switch is on
man_control_landing_gear_up: the landing gear's switch is up
man_control_rtl_engaged: the return switch is on
missing_cpuload: autopilot: the load of its processor is unknown
missing_fmu_sdcard: autopilot: no SD card
missing_system_power: autopilot: its power supply is unknown
mission_failure: its own mission cannot be flown
modes_angular_velocity: rate of turn unknown
modes_attitude: attitude unknown
modes_cannot_takeoff: it cannot take off in its present mode
modes_global_pos: global position unknown
modes_home_position: home position unknown
modes_local_alt: height unknown
modes_local_pos: position unknown
modes_manual_control: its present mode needs a remote control
modes_mission: its present mode needs a mission
modes_offboard_signal: its present mode needs setpoints
motor_overcurrent: motors: one draws too much current
motor_undercurrent: motors: one draws too little current
navigator_failure_hagl: height above the ground unknown
optical_flow_sensor_invalid: optical flow: not valid
optical_sensor_missing: optical flow: missing
parachute_missing: parachute: missing
parachute_unhealthy: parachute: unhealthy
power_oc_hipower: power supply: too much current
power_oc_periph: power supply: too much current
power_oc_report: power supply: too much current
ram_usage_too_high: autopilot: its memory is full
rc_dl_no_dllink: the ground station is lost
rc_max_too_high: remote control: wrongly calibrated
rc_min_too_small: remote control: wrongly calibrated
rc_trim_too_high: remote control: wrongly calibrated
rc_trim_too_small: remote control: wrongly calibrated
system_arm_auth_failed: arming was not authorised
system_flight_term_active: its flight was terminated
system_no_global_pos: global position unknown
system_no_home_pos: home position unknown
system_safety_button: the safety button is not pressed
system_usb_connected: it is connected by USB
task_watchdog_present: autopilot: a task of its own hung
wind_too_high: wind: too strong
"""
_COMMANDER = """
arm_denied_calibrating: it does not arm while it is being calibrated
arm_denied_not_manual: it does not arm in this mode
arm_denied_resolve_failures: it does not arm before its checks pass
arm_denied_throttle_center: it does not arm: the throttle is not in the middle
arm_denied_throttle_high: it does not arm: the throttle is up
disarm_denied_not_landed: it does not stop its motors in the air
failsafe_enter_crit_bat_warn: battery: critical
failsafe_enter_crit_low_bat_warn: battery: critical
failsafe_enter_generic_hold: its own protection holds it
failsafe_enter_generic_warn: its own protection warns
failsafe_enter_hold: its own protection holds it
failsafe_enter_low_bat: battery: low
failsafe_enter_low_flight_time_warn: battery: little time of flight is left
gcs_lost: the ground station is lost
kill_sw_engaged: the kill switch was used
max_flight_time_warning_seconds: the longest time of flight is nearly over
mission_start_denied_no_mission: it has no mission of its own to start
modeswitch_not_avail: the mode is not available now
rc_lost: remote control: lost
rc_override: a pilot has taken over by remote control
rtl: it returns home
unsupported_auto_mode: the mode is not known to it
unsupported_base_mode: the mode is not known to it
unsupported_main_mode: the mode is not known to it
"""


def _table(lines: str) -> dict[str, str]:
    pairs = (line.split(": ", 1) for line in lines.strip().splitlines())
    return {name: words for name, words in pairs}  # noqa: C416 - pairs are lists


CHECKS = _table(_CHECKS)
"""Of the arming and health checks, `check_…`."""
COMMANDER = _table(_COMMANDER)
"""Of the commander itself, `commander_…`; the mode shows that its protection takes over."""
CAUSES = {
    1: "remote control: lost",
    2: "the ground station is lost",
    3: "battery: low",
    4: "battery: critical",
    5: "battery: about to be empty",
    6: "battery: little time of flight is left",
}
"""Of a failsafe, by PX4's `failsafe_cause_t`; the generic one, 0, is in its report of checks."""
