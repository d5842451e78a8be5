"""Started by test_mavsdk.py, with a Python that has MAVSDK: `mavsdk_client.py PORT`."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable

from mavsdk import ComponentType, Configuration, Mavsdk  # type: ignore[import-not-found]
from mavsdk.plugins.action import Action  # type: ignore[import-not-found]
from mavsdk.plugins.offboard import Offboard, VelocityNedYaw  # type: ignore[import-not-found]
from mavsdk.plugins.param import Param  # type: ignore[import-not-found]
from mavsdk.plugins.telemetry import Telemetry  # type: ignore[import-not-found]


def _until(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.1)


def main() -> None:
    """Arm, take off, offboard, land; print what was seen as JSON."""
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    sdk.add_any_connection(f"udpin://127.0.0.1:{sys.argv[1]}")
    system = sdk.first_autopilot(15.0)
    action, telemetry = Action(system), Telemetry(system)
    seen: dict[str, object] = {"autopilot": system.autopilot_type().name}
    _until(lambda: abs(telemetry.position().latitude_deg) > 1.0)
    seen["parameter"] = Param(system).get_param_int("COM_LOW_BAT_ACT")
    action.set_takeoff_altitude(3.0)
    action.arm()
    action.takeoff()
    _until(lambda: telemetry.position().relative_altitude_m > 2.0)
    seen["height"] = telemetry.position().relative_altitude_m
    seen["armed"] = telemetry.armed()
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
