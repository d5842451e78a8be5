"""PX4 and ArduPilot apart: modes, take-offs, fences and parameters, each in its own numbers."""

from __future__ import annotations

import pytest

from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.state.telemetry import Sensors, Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink

CHECK = mavlink.MAV_SYS_STATUS_PREARM_CHECK


def px4_mode(main: int, sub: int = 0) -> int:
    """PX4's custom mode: the main one in its third byte, the sub mode in its fourth."""
    return main << 16 | sub << 24


@pytest.mark.parametrize(
    ("main", "sub", "mode", "name"),
    [
        (6, 0, FlightMode.GUIDED, "offboard"),
        (6, 9, FlightMode.GUIDED, "offboard"),
        (4, 2, FlightMode.TAKE_OFF, "take-off"),
        (4, 3, FlightMode.HOLD, "hold"),
        (4, 4, FlightMode.MISSION, "mission"),
        (4, 5, FlightMode.RETURN, "return"),
        (4, 6, FlightMode.LAND, "land"),
        (4, 99, FlightMode.OTHER, "mode 4/99"),
        (3, 0, FlightMode.OTHER, "position"),
        (3, 5, FlightMode.OTHER, "position"),
        (1, 0, FlightMode.OTHER, "manual"),
        (77, 3, FlightMode.OTHER, "mode 77/3"),
    ],
)
def test_modes_of_px4(main: int, sub: int, mode: FlightMode, name: str) -> None:
    """A sub mode counts in its automatic mode only; the two low bytes say nothing."""
    for low in (0, 0xFFFF):
        assert PX4().mode(px4_mode(main, sub) | low) is mode
        assert PX4().mode_name(px4_mode(main, sub) | low) == name


@pytest.mark.parametrize(
    ("number", "mode", "name"),
    [
        (0, FlightMode.OTHER, "stabilize"),
        (4, FlightMode.GUIDED, "guided"),
        (5, FlightMode.OTHER, "loiter"),
        (6, FlightMode.RETURN, "return"),
        (21, FlightMode.RETURN, "smart return"),
        (9, FlightMode.LAND, "land"),
        (17, FlightMode.HOLD, "brake"),
        (99, FlightMode.OTHER, "mode 99"),
    ],
)
def test_modes_of_ardupilot(number: int, mode: FlightMode, name: str) -> None:
    """By ArduCopter's numbers."""
    assert ArduPilot().mode(number) is mode
    assert ArduPilot().mode_name(number) == name


@pytest.mark.parametrize(
    ("mode", "px4", "ardupilot"),
    [
        (FlightMode.GUIDED, (6, 0), 4),
        (FlightMode.TAKE_OFF, (4, 2), 4),
        (FlightMode.HOLD, (4, 3), 17),
        (FlightMode.RETURN, (4, 5), 6),
        (FlightMode.LAND, (4, 6), 9),
    ],
)
def test_asking_for_a_mode(mode: FlightMode, px4: tuple[int, int], ardupilot: int) -> None:
    """The first parameter says that the custom mode counts; what was asked is shown then."""
    order = PX4().ask_mode(mode)
    assert order.number == mavlink.MAV_CMD_DO_SET_MODE
    assert list(order.values) == [1.0, *px4, 0.0, 0.0, 0.0, 0.0]
    assert (order.mode, order.what) == (mode, f"mode {mode.value}")
    assert order.frame is None
    assert PX4().mode(px4_mode(*px4)) is mode
    order = ArduPilot().ask_mode(mode)
    assert order.number == mavlink.MAV_CMD_DO_SET_MODE
    assert list(order.values) == [1.0, ardupilot, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert (order.mode, order.what) == (mode, f"mode {mode.value}")
    assert order.frame is None


@pytest.mark.parametrize(
    ("action", "px4", "ardupilot"),
    [("warn", 1.0, 0.0), ("hold", 2.0, 4.0), ("return", 3.0, 1.0), ("land", 5.0, 2.0)],
)
def test_what_a_fence_does(action: str, px4: float, ardupilot: float) -> None:
    """Each action by its number, the ceiling in metres, and ArduPilot's fence switched on."""
    assert PX4().fence(action, 40.0) == {  # type: ignore[arg-type]
        "GF_ACTION": px4,
        "GF_MAX_VER_DIST": 40.0,
    }
    assert ArduPilot().fence(action, 40.0) == {  # type: ignore[arg-type]
        "FENCE_ACTION": ardupilot,
        "FENCE_ALT_MAX": 40.0,
        "FENCE_TYPE": 5.0,
        "FENCE_ENABLE": 1.0,
    }


def telling(present: int, health: int) -> Telemetry:
    """A vehicle whose sensors are present and healthy by these bits."""
    telemetry = Telemetry()
    telemetry.sensors = Sensors(present, present, health)
    telemetry.altitude = 488.0
    return telemetry


def test_what_ardupilot_objects_to() -> None:
    """Its texts before arming, at most 35 s old; none while its checks pass or nobody knows."""
    for telemetry in (Telemetry(), telling(1, 0), telling(CHECK, CHECK)):
        telemetry.texts.add("PreArm: compass", 3, 100.0)
        assert ArduPilot().objections(telemetry, 100.0) == []
    failing = telling(CHECK, 0)
    assert ArduPilot().objections(failing, 100.0) == ["ArduPilot's arming checks fail"]
    for text in ("PreArm: compass", "Arm: throttle", "GPS glitch", "PreArm: compass"):
        failing.texts.add(text, 2, 100.0)
    assert ArduPilot().objections(failing, 135.0) == ["PreArm: compass", "Arm: throttle"]
    assert ArduPilot().objections(failing, 135.1) == ["ArduPilot's arming checks fail"]
