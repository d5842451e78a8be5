"""Signs, units and axes of what is said to an autopilot and what it says: NED there, ENU here."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from aerodaas.drivers.mavlink.control.guidance import Target
from aerodaas.drivers.mavlink.control.steering import position_message, velocity_message
from aerodaas.drivers.mavlink.state.frames import LocalFrame, attitude_from_frd
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.geometry.frames import GeodeticOrigin, Vector
from aerodaas.messages.vehicle import VelocitySetpoint

HOME = GeodeticOrigin(47.0, 8.0, 500.0)
FRAME = LocalFrame(np.array([100.0, 200.0, 50.0]))
"""The autopilot began 100 m east, 200 m north and 50 m above our zero."""


def vector(*values: float) -> Vector:
    """An array of floats."""
    return np.array(values, np.float64)


def fields(message: Any, *names: str) -> list[float]:  # noqa: ANN401 - pymavlink has no types
    """Some of a message's fields."""
    return [getattr(message, name) for name in names]


@pytest.mark.parametrize(
    ("north", "east", "down", "enu"),
    [
        (0.0, 0.0, 0.0, (100.0, 200.0, 50.0)),
        (10.0, 0.0, 0.0, (100.0, 210.0, 50.0)),
        (0.0, 10.0, 0.0, (110.0, 200.0, 50.0)),
        (0.0, 0.0, 10.0, (100.0, 200.0, 40.0)),
    ],
)
def test_each_axis_of_a_place(
    north: float, east: float, down: float, enu: tuple[float, float, float]
) -> None:
    """10 m north, east or down of where the autopilot began, one at a time, and back."""
    assert FRAME.position(vector(north, east, down)) == pytest.approx(enu)
    assert FRAME.place(vector(*enu)) == pytest.approx([north, east, down])


def test_a_velocity_has_no_origin() -> None:
    """1 m/s north, 2 east, 3 down is 2 east, 1 north, -3 up, wherever the frame begins."""
    assert LocalFrame.velocity(vector(1.0, 2.0, 3.0)) == pytest.approx([2.0, 1.0, -3.0])
    assert LocalFrame.velocity(vector(2.0, 1.0, -3.0)) == pytest.approx([1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("yaw", "heading"), [(0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (-90.0, 180.0), (45.0, 45.0)]
)
def test_our_yaw_and_their_heading(yaw: float, heading: float) -> None:
    """We count from east against the clock, they from north with it; either way the same place."""
    told = math.degrees(LocalFrame.heading(math.radians(yaw)))
    assert told == pytest.approx(heading)
    back = attitude_from_frd(0.0, 0.0, math.radians(heading), 0.0)
    assert math.degrees(back.yaw) == pytest.approx(yaw)


def test_a_frame_is_laid_over_home_by_latitude_and_longitude_alone() -> None:
    """0.001 degrees north of home are 111 m north; up is what is said, no height of the globe's."""
    frame = LocalFrame.over_home(HOME, 47.001, 8.0, 7.0, vector(5.0, 0.0, -7.0))
    assert frame.position(vector(5.0, 0.0, -7.0)) == pytest.approx([0.0, 111.2, 7.0], abs=0.1)
    assert frame.origin == pytest.approx([0.0, 106.2, 0.0], abs=0.1)
    frame = LocalFrame.over_home(HOME, 47.0, 8.001, 2.0, vector(0.0, 3.0, 0.0))
    assert frame.position(vector(0.0, 3.0, 0.0)) == pytest.approx([76.1, 0.0, 2.0], abs=0.1)


def test_a_target_on_the_wire() -> None:
    """A place, a velocity and a heading in NED of the autopilot's own origin; nothing else counts.

    5 m east of its origin, 7 m north and 3 m above, at 1 m/s east, 2 north and 0.5 up, looking
    north, which is heading 0.
    """
    target = Target(vector(105.0, 207.0, 53.0), vector(1.0, 2.0, 0.5), math.pi / 2)
    message = position_message(target, FRAME, (7, 1), 12.345)
    assert message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    assert fields(message, "target_system", "target_component") == [7, 1]
    assert message.time_boot_ms == 12345
    assert message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED
    assert fields(message, "x", "y", "z") == pytest.approx([7.0, 5.0, -3.0])
    assert fields(message, "vx", "vy", "vz") == pytest.approx([2.0, 1.0, -0.5])
    assert fields(message, "afx", "afy", "afz") == [0.0, 0.0, 0.0]
    assert message.yaw == pytest.approx(0.0)
    assert message.yaw_rate == 0.0
    ignored = (
        mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
    )
    assert message.type_mask == ignored


def test_a_velocity_on_the_wire() -> None:
    """1 m/s east, 2 north, 0.5 up; 0.3 rad/s against the clock is -0.3 to them."""
    setpoint = VelocitySetpoint(vector(1.0, 2.0, 0.5), 0.3)
    message = velocity_message(setpoint, (7, 1), 3.0)
    assert fields(message, "target_system", "target_component") == [7, 1]
    assert message.time_boot_ms == 3000
    assert message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED
    assert fields(message, "x", "y", "z") == [0.0, 0.0, 0.0]
    assert fields(message, "vx", "vy", "vz") == pytest.approx([2.0, 1.0, -0.5])
    assert fields(message, "afx", "afy", "afz") == [0.0, 0.0, 0.0]
    assert message.yaw == 0.0
    assert message.yaw_rate == pytest.approx(-0.3)
    ignored = (
        mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    )
    assert message.type_mask == ignored


def test_the_milliseconds_of_a_long_life_fit_the_wire() -> None:
    """A host that has been up for 50 days counts on from zero: 2^32 ms are 49.7 days."""
    setpoint = VelocitySetpoint(np.zeros(3))
    target = Target(np.zeros(3), np.zeros(3), 0.0)
    for now, stamp in ((4294967.296, 0), (4294967.297, 1), (4294967.295, 4294967295)):
        assert velocity_message(setpoint, (1, 1), now).time_boot_ms == stamp
        assert position_message(target, FRAME, (1, 1), now).time_boot_ms == stamp
