"""Complaints about a vehicle's health at their limits: from which figure on, and after how long."""

from __future__ import annotations

from typing import Any

import pytest

from aerodaas.drivers.mavlink.state.health import Health
from aerodaas.drivers.mavlink.wire.dialect import mavlink

WELL = 0x3F
"""Attitude, velocities and positions of an estimator."""
HORIZONTAL = mavlink.ESTIMATOR_POS_HORIZ_REL | mavlink.ESTIMATOR_POS_HORIZ_ABS
BATTERY = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY


def gps(fix: int) -> Any:  # noqa: ANN401 - pymavlink has no types
    """A GPS with this kind of fix."""
    return mavlink.MAVLink_gps_raw_int_message(0, fix, 1, 1, 0, 80, 80, 0, 0, 9)


def estimator(flags: int = WELL, along: float = 0.5, up: float = 0.5, compass: float = 0.1) -> Any:  # noqa: ANN401
    """PX4's estimator: how unsure it is in metres, and the compass' ratio."""
    return mavlink.MAVLink_estimator_status_message(
        0, flags, 9.0, 9.0, 9.0, compass, 9.0, 9.0, along, up
    )


def ekf(
    flags: int = WELL, *, speed: float = 0, along: float = 0, up: float = 0, compass: float = 0
) -> Any:  # noqa: ANN401
    """ArduPilot's estimator: variances."""
    return mavlink.MAVLink_ekf_status_report_message(flags, speed, along, up, compass, 9.0)


def misfit(name: str, variance: float) -> Any:  # noqa: ANN401
    """One of ArduPilot's variances."""
    return ekf(**{"flags": WELL, name: variance})  # type: ignore[arg-type]


def battery(charge: int, faults: int = 0, number: int = 0) -> Any:  # noqa: ANN401
    """A battery's word about itself."""
    return mavlink.MAVLink_battery_status_message(
        number, 0, 0, 2000, [3700] * 10, 0, 0, 0, 50, 0, charge, [0] * 4, 0, faults
    )


def status(present: int, enabled: int, healthy: int) -> Any:  # noqa: ANN401
    """The sensors' bits."""
    return mavlink.MAVLink_sys_status_message(
        present, enabled, healthy, 100, 12000, 500, 50, 0, 0, 0, 0, 0, 0
    )


def shaking(*axes: float, clipped: tuple[int, ...] = (0, 0, 0)) -> Any:  # noqa: ANN401
    """How it shakes along three axes, and samples that three accelerometers could not measure."""
    return mavlink.MAVLink_vibration_message(0, *(axes or (0.0,) * 3), *clipped)


def lasting(*messages: Any) -> list[str]:  # noqa: ANN401
    """What is told of a vehicle that has said each of these, and said the last for a second."""
    health = Health()
    for now, message in enumerate((*messages, messages[-1])):
        health.take(message, float(now))
    return health.faults(float(len(messages)))


def test_a_complaint_is_told_from_its_first_second_on() -> None:
    """Not a moment before; a text that changes meanwhile is the same complaint."""
    health = Health()
    health.take(estimator(along=6.0), 10.0)
    health.take(estimator(along=11.0), 10.75)
    assert health.faults(10.99) == []
    assert health.faults(11.0) == ["estimator: position unsure by more than 10 m"]
    health.take(estimator(), 11.5)
    health.take(estimator(along=11.0), 12.0)
    assert health.faults(12.5) == []


@pytest.mark.parametrize(
    ("metres", "told"),
    [
        (5.0, ""),
        (5.1, "5"),
        (10.0, "5"),
        (10.1, "10"),
        (20.1, "20"),
        (50.0, "20"),
        (50.1, "50"),
        (100.0, "50"),
        (1e9, "100"),
    ],
)
def test_how_unsure_an_estimator_is(metres: float, told: str) -> None:
    """In steps of 5, 10, 20, 50 and 100 m, along the ground and upwards."""
    words = [f"estimator: position unsure by more than {told} m"] if told else []
    assert lasting(estimator(along=metres)) == words
    words = [f"estimator: height unsure by more than {told} m"] if told else []
    assert lasting(estimator(up=metres)) == words


@pytest.mark.parametrize(
    ("variance", "ill"),
    [
        ("along", "position"),
        ("speed", "velocity"),
        ("up", "height"),
        ("compass", "compass"),
    ],
)
def test_each_variance_by_its_name(variance: str, ill: str) -> None:
    """ArduPilot mistrusts what is above 0.8."""
    words = f"estimator: what is measured of its {ill} does not fit"
    assert lasting(misfit(variance, 0.81)) == [words]
    # 0.8 becomes a little more on the wire: a single has seven digits.
    assert lasting(misfit(variance, 0.79)) == []
    assert lasting(misfit(variance, 0.81), ekf()) == []


def test_a_compass_may_be_off_by_its_whole_gate() -> None:
    """PX4's ratio of 1 is the gate itself."""
    assert lasting(estimator(compass=1.0)) == []
    words = ["estimator: what is measured of its compass does not fit"]
    assert lasting(estimator(compass=1.01)) == words


@pytest.mark.parametrize(
    ("flags", "lost"),
    [
        (WELL, False),
        (WELL & ~mavlink.ESTIMATOR_POS_HORIZ_REL, False),
        (WELL & ~mavlink.ESTIMATOR_POS_HORIZ_ABS, False),
        (WELL & ~HORIZONTAL, True),
    ],
)
def test_either_kind_of_position_along_the_ground_is_one(flags: int, *, lost: bool) -> None:
    """Relative or absolute; to both families."""
    words = ["estimator: no position along the ground"] if lost else []
    assert lasting(estimator(flags)) == words
    assert lasting(ekf(flags)) == words


def test_a_constant_position_is_none_to_ardupilot_alone() -> None:
    """PX4 sets that bit when all is well."""
    constant = WELL | mavlink.ESTIMATOR_CONST_POS_MODE
    assert lasting(estimator(constant)) == []
    assert lasting(ekf(constant)) == ["estimator: no position along the ground"]


def test_a_glitch_is_each_familys_own_bit() -> None:
    """1024 to PX4, 32768 to ArduPilot, and not the other way round."""
    words = ["estimator: GPS positions jump, and are not believed"]
    assert lasting(estimator(WELL | 1024)) == lasting(ekf(WELL | 32768)) == words
    assert lasting(estimator(WELL | 32768)) == lasting(ekf(WELL | 1024)) == []


def test_an_estimator_is_lost_after_a_second() -> None:
    """Until then it may find its place again; afterwards until it says so."""
    health = Health()
    assert not health.lost(10.0)
    for now, lost in ((10.0, False), (10.9, False), (11.0, True), (15.0, True)):
        health.take(estimator(WELL & ~HORIZONTAL), now)
        assert health.lost(now) is lost
    health.take(estimator(), 15.5)
    assert not health.lost(20.0)


@pytest.mark.parametrize(
    ("ill", "sure"),
    [
        (gps(2), False),
        (estimator(along=6.0), False),
        (estimator(WELL & ~HORIZONTAL), False),
        (estimator(WELL | 1024), False),
        (estimator(up=6.0), True),
        (estimator(compass=2.0), True),
        (battery(3), True),
    ],
)
def test_what_makes_a_position_unsure(ill: Any, *, sure: bool) -> None:  # noqa: ANN401
    """At once: the fix, the estimator's own doubt, its loss, and a GPS that jumps."""
    health = Health()
    health.take(gps(3), 0.0)
    assert health.sure_of_position
    health.take(ill, 1.0)
    assert health.sure_of_position is sure


@pytest.mark.parametrize(("gaps", "silent"), [(8, False), (9, True)])
def test_a_gps_is_silent_after_four_seconds_of_others(gaps: int, *, silent: bool) -> None:
    """Eight words of others, half a second apart, are four; one word of its own ends it."""
    health = Health()
    health.take(gps(3), 10.0)
    for half in range(1, gaps + 1):
        health.take(shaking(), 10.0 + half / 2)
    assert health.faults(15.0) == (["GPS: it has fallen silent"] if silent else [])
    health.take(gps(3), 15.0)
    assert health.faults(15.0) == []


def test_a_gap_in_what_is_heard_counts_as_one_second() -> None:
    """Three gaps of ten seconds are three, the fourth four, the fifth more."""
    health = Health()
    health.take(gps(3), 0.0)
    for gap in range(1, 6):
        health.take(shaking(), 10.0 * gap)
        assert bool(health.faults(10.0 * gap)) is (gap == 5)


def test_a_fix_that_is_lost() -> None:
    """By what is left of it, if there ever was one; the attitude is a complaint of its own."""
    assert lasting(gps(3), gps(2)) == ["GPS: a fix in the plane only"]
    assert lasting(gps(3), gps(1)) == lasting(gps(4), gps(0)) == ["GPS: no fix"]
    assert lasting(gps(2)) == lasting(gps(3), gps(1), gps(3)) == []
    unknown = ["estimator: attitude unknown"]
    assert lasting(estimator(WELL & ~1)) == lasting(ekf(WELL & ~1)) == unknown


def test_silence_comes_first_and_nothing_twice() -> None:
    """A battery that both it and its autopilot call unhealthy is one complaint."""
    health = Health()
    health.take(gps(3), 0.0)
    health.take(status(BATTERY, BATTERY, 0), 0.0)
    health.take(battery(mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY), 0.0)
    assert health.faults(1.0) == ["battery: unhealthy"]
    for second in range(1, 6):
        health.take(shaking(), float(second))
    assert health.faults(6.0) == ["GPS: it has fallen silent", "battery: unhealthy"]


@pytest.mark.parametrize(
    ("bit", "words"),
    [
        (1, "discharged too deeply"),
        (2, "its voltage jumps"),
        (4, "a cell has failed"),
        (8, "too much current"),
        (16, "too hot"),
        (32, "too cold"),
        (64, "its voltage does not fit the vehicle"),
    ],
)
def test_each_fault_of_a_battery(bit: int, words: str) -> None:
    """By the name of the battery: the first has no number."""
    assert lasting(battery(0, bit)) == [f"battery: {words}"]
    assert lasting(battery(1, bit, number=2)) == [f"battery 3: {words}"]


@pytest.mark.parametrize(
    ("charge", "words"),
    [
        (2, "low"),
        (3, "critical"),
        (4, "about to be empty"),
        (5, "failed"),
        (6, "unhealthy"),
    ],
)
def test_each_charge_of_a_battery(charge: int, words: str) -> None:
    """Beside its faults; a battery that charges, or is well, is no complaint."""
    assert lasting(battery(charge)) == [f"battery: {words}"]
    assert lasting(battery(charge, 1 | 32)) == [
        f"battery: {words}, discharged too deeply, too cold"
    ]
    assert lasting(battery(1)) == lasting(battery(7)) == []
    assert lasting(battery(charge), battery(charge, number=1))[1:] == [f"battery 2: {words}"]


def test_once_a_battery_spoke_for_itself_the_autopilots_bit_is_old_news() -> None:
    """Even if a later word, or another battery's, does not say its charge."""
    bit = status(BATTERY, BATTERY, 0)
    assert lasting(battery(1), battery(0), bit) == []
    assert lasting(battery(0), bit) == ["battery: unhealthy"]


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_vibration_is_the_worst_axis(axis: str) -> None:
    """More than 30 m/s² is told, and more than 60."""
    for shakes, told in ((30.0, ""), (30.5, "30"), (60.0, "30"), (60.5, "60")):
        words = [f"vibration: more than {told} m/s²"] if told else []
        assert lasting(shaking(*(shakes * (name == axis) for name in "xyz"))) == words


@pytest.mark.parametrize("sensor", [0, 1, 2])
def test_clipping_is_what_was_added_since(sensor: int) -> None:
    """By any of three accelerometers: more than 10 between two words; the first says nothing."""

    def told(step: int) -> list[str]:
        health = Health()
        for second in range(4):
            counts = [100, 100, 100]
            counts[sensor] += second * step
            health.take(shaking(clipped=tuple(counts)), float(second))
        return health.faults(3.0)

    assert told(10) == []
    assert told(11) == ["vibration: beyond what the accelerometers measure"]


SENSORS = {
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO2: "second gyroscope",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL: "accelerometer",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG: "compass",
    mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE: "barometer",
    mavlink.MAV_SYS_STATUS_AHRS: "attitude and heading",
    BATTERY: "battery",
}


def test_sensors_that_are_ill_are_all_named() -> None:
    """Those that are present and enabled, until they are well."""
    every = sum(SENSORS)
    words = [f"{name}: unhealthy" for name in SENSORS.values()]
    assert sorted(lasting(status(every, every, 0))) == sorted(words)
    assert lasting(status(every, every, 0), status(every, every, every)) == []
    assert lasting(status(every, 0, 0)) == lasting(status(0, every, 0)) == []
    one = mavlink.MAV_SYS_STATUS_AHRS
    assert lasting(status(every, every, every & ~one)) == ["attitude and heading: unhealthy"]
