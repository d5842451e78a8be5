"""Started by test_mavsdk.py, with a Python that has MAVSDK: `mavsdk_client.py PORT`."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.geofence import Geofence
from mavsdk.plugins.info import Info
from mavsdk.plugins.offboard import Offboard, VelocityNedYaw
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry

_ROUND = 1e-5
"""Degrees of latitude: a metre."""


def _until(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.1)


def main() -> None:
    """Ask, arm, take off, go to a place, offboard, land; print what was seen as JSON."""
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    sdk.add_any_connection(f"udpin://127.0.0.1:{sys.argv[1]}")
    system = sdk.first_autopilot(15.0)
    action, telemetry, parameters = Action(system), Telemetry(system), Param(system)
    seen: dict[str, object] = {"autopilot": system.autopilot_type().name}
    px4 = seen["autopilot"] == "PX4"
    if not px4:
        # ArduPilot sends nothing that was not asked for, the real one neither.
        for name in ("position", "gps_info", "battery", "attitude_euler", "velocity_ned"):
            getattr(telemetry, f"set_rate_{name}")(5.0)
    _until(lambda: abs(telemetry.position().latitude_deg) > 1.0)
    _until(lambda: telemetry.gps_info().num_satellites > 0)
    version = Info(system).get_version()
    seen["version"] = [version.flight_sw_major, version.flight_sw_minor, version.flight_sw_patch]
    everything = parameters.get_all_params()
    seen["parameters"] = len(everything.int_params) + len(everything.float_params)
    Geofence(system).clear_geofence()
    seen["satellites"] = telemetry.gps_info().num_satellites
    _until(lambda: telemetry.battery().remaining_percent > 0.0)
    seen["battery"] = telemetry.battery().remaining_percent
    _until(lambda: telemetry.health().is_global_position_ok, 3.0)
    seen["global position"] = telemetry.health().is_global_position_ok
    if px4:
        seen["parameter"] = parameters.get_param_int("COM_LOW_BAT_ACT")
        seen["all well"] = telemetry.health_all_ok()
    action.set_takeoff_altitude(3.0)
    action.arm()
    action.takeoff()
    _until(lambda: telemetry.position().relative_altitude_m > 2.0)
    seen["height"] = telemetry.position().relative_altitude_m
    seen["armed"] = telemetry.armed()
    time.sleep(4.0)
    here = telemetry.position()
    north = here.latitude_deg + 5 * _ROUND
    action.goto_location(north, here.longitude_deg, here.absolute_altitude_m + 1.0, 90.0)
    _until(lambda: abs(telemetry.position().latitude_deg - north) < _ROUND / 2)
    seen["metres from there"] = abs(telemetry.position().latitude_deg - north) / _ROUND * 1.1
    if px4:
        offboard = Offboard(system)
        offboard.set_velocity_ned(VelocityNedYaw(1.0, 0.0, 0.0, 0.0))
        time.sleep(0.5)
        offboard.start()
        time.sleep(3.0)
        seen["north"] = telemetry.position_velocity_ned().velocity.north_m_s
    action.land()
    _until(lambda: not telemetry.armed())
    seen["armed at last"] = telemetry.armed()
    sys.stdout.write(json.dumps(seen) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
