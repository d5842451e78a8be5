"""Figures of health from the messages that carry them, for the list before take-off."""

from __future__ import annotations

from typing import Any

import pytest
from emulated import Flight

from aerodaas.drivers.mavlink.state.health import Health
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.errors import VehicleError
from tools.mavlink_vehicle import AutopilotOptions

NAN = float("nan")
UNKNOWN = 65535


def battery(cells: list[int], *more: int, number: int = 0) -> Any:  # noqa: ANN401 - pymavlink has no types
    """Cells in millivolts, ten and four."""
    filled = [*cells, *[UNKNOWN] * (10 - len(cells))]
    return mavlink.MAVLink_battery_status_message(
        number, 0, 0, 2000, filled, 0, 0, 0, 50, 0, 1, [*more, *[0] * (4 - len(more))]
    )


def after(*messages: Any) -> Health:  # noqa: ANN401
    """Health after these messages."""
    health = Health()
    for message in messages:
        health.take(message, 100.0)
    return health


@pytest.mark.parametrize(
    ("message", "cells"),
    [
        (battery([4100, 4090, 4110]), (4.1, 4.09, 4.11)),
        (battery([3700] * 10, 3600, 3650), (3.7,) * 10 + (3.6, 3.65)),
        (battery([4200]), (4.2,)),
        (battery([12600]), None),
        (battery([]), None),
    ],
)
def test_cells(message: Any, cells: tuple[float, ...] | None) -> None:  # noqa: ANN401
    """A battery's whole voltage, which stands in the first one's place, is no cell."""
    assert after(message).cells == cells
    assert after(message, battery([4000, 3000], number=1)).cells == cells


def test_cycles() -> None:
    """Of the first battery, where it counts them."""
    message = mavlink.MAVLink_smart_battery_info_message

    def info(cycles: int, number: int = 0) -> Any:  # noqa: ANN401
        return message(number, 0, 0, 5000, 4800, cycles, b"", b"", 0, 0, 0, 0)

    assert after(info(120)).cycles == 120
    assert after(info(120), info(7, number=1)).cycles == 120
    assert after(info(UNKNOWN)).cycles is None


def test_misfits() -> None:
    """The compass' own, and the largest of all others; what is no number does not count."""
    px4 = mavlink.MAVLink_estimator_status_message
    health = after(px4(0, 0x3F, 0.2, NAN, 0.4, 0.3, NAN, NAN, 0.5, 0.4))
    assert (health.compass, health.estimator) == pytest.approx((0.3, 0.4))
    ekf = mavlink.MAVLink_ekf_status_report_message(0x3F, 0.1, 0.7, 0.2, 0.5, 0.0)
    health = after(ekf)
    assert (health.compass, health.estimator) == pytest.approx((0.5, 0.7))
    health = after(px4(0, 0x3F, NAN, NAN, NAN, NAN, NAN, NAN, 0.5, 0.4))
    assert (health.compass, health.estimator) == (None, None)


def test_vibration_and_fix() -> None:
    """The axis that shakes most; a fix in the plane is none in space."""
    assert after(mavlink.MAVLink_vibration_message(0, 1.0, 3.0, 2.0, 0, 0, 0)).vibration == 3.0
    for kind, fixed in ((3, True), (6, True), (2, False), (0, False)):
        gps = mavlink.MAVLink_gps_raw_int_message(0, kind, 1, 1, 0, 80, 80, 0, 0, 9)
        assert after(gps).gps_fix is fixed
        assert after(gps).gps_rtk == ("RTK fixed" if kind == 6 else "")
    nothing = after()
    assert (nothing.vibration, nothing.gps_fix, nothing.cells) == (None, None, None)


@pytest.mark.parametrize("family", ["px4", "ardupilot"])
def test_a_connected_vehicle_tells_all_of_it(flight: Flight, family: str) -> None:
    """As far as the emulated ones model it; without a connection it is an error."""
    with flight(AutopilotOptions(family=family), fallback="report") as pair:  # type: ignore[arg-type]
        pair.wait(lambda: pair.vehicle.health().vibration is not None)
        pair.wait(lambda: pair.vehicle.health().estimator is not None)
        told = pair.vehicle.health()
        assert told.gps_fix is True
        assert told.cells is None
        assert told.silence is not None
        assert told.silence < 1.0
        assert told.clock == pytest.approx(1.8e9, abs=60.0)
        assert told.stranded
        pair.vehicle.close()
        with pytest.raises(VehicleError, match="not connected"):
            pair.vehicle.health()
    with flight(AutopilotOptions(family=family)) as pair:  # type: ignore[arg-type]
        assert pair.vehicle.health().stranded is None
