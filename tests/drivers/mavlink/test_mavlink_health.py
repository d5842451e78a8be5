"""Health: what is told of it and from which figure on, its arming checks, and its readings."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from emulated import Flight
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.microservices.event_words import CHECKS, COMMANDER
from aerodaas.drivers.mavlink.microservices.events import EventReader, event_number
from aerodaas.drivers.mavlink.state.health import Health
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from tools.mavlink_vehicle import AutopilotOptions

NAN = float("nan")
UNKNOWN = 65535
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
        health.on_message(message, float(now))
    return health.faults(float(len(messages)))


def test_a_complaint_is_told_from_its_first_second_on() -> None:
    """Not a moment before; a text that changes meanwhile is the same complaint."""
    health = Health()
    health.on_message(estimator(along=6.0), 10.0)
    health.on_message(estimator(along=11.0), 10.75)
    assert health.faults(10.99) == []
    assert health.faults(11.0) == ["estimator: position unsure by more than 10 m"]
    health.on_message(estimator(), 11.5)
    health.on_message(estimator(along=11.0), 12.0)
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


def test_an_estimator_is_lost_after_a_second() -> None:
    """Until then it may find its place again; afterwards until it says so."""
    health = Health()
    assert not health.lost(10.0)
    for now, lost in ((10.0, False), (10.9, False), (11.0, True), (15.0, True)):
        health.on_message(estimator(WELL & ~HORIZONTAL), now)
        assert health.lost(now) is lost
    health.on_message(estimator(), 15.5)
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
    health.on_message(gps(3), 0.0)
    assert health.sure_of_position
    health.on_message(ill, 1.0)
    assert health.sure_of_position is sure


@pytest.mark.parametrize(("gaps", "silent"), [(8, False), (9, True)])
def test_a_gps_is_silent_after_four_seconds_of_others(gaps: int, *, silent: bool) -> None:
    """Eight words of others, half a second apart, are four; one word of its own ends it."""
    health = Health()
    health.on_message(gps(3), 10.0)
    for half in range(1, gaps + 1):
        health.on_message(shaking(), 10.0 + half / 2)
    assert health.faults(15.0) == (["GPS: it has fallen silent"] if silent else [])
    health.on_message(gps(3), 15.0)
    assert health.faults(15.0) == []


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
    health.on_message(gps(3), 0.0)
    health.on_message(status(BATTERY, BATTERY, 0), 0.0)
    health.on_message(battery(mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY), 0.0)
    assert health.faults(1.0) == ["battery: unhealthy"]
    for second in range(1, 6):
        health.on_message(shaking(), float(second))
    assert health.faults(6.0) == ["GPS: it has fallen silent", "battery: unhealthy"]


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
            health.on_message(shaking(clipped=tuple(counts)), float(second))
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


CHECK, GPS = mavlink.MAV_SYS_STATUS_PREARM_CHECK, mavlink.MAV_SYS_STATUS_SENSOR_GPS
GYRO = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
SEQUENCE = itertools.count()


def test_an_estimator_that_is_lost_leaves_no_position() -> None:
    """Packets with a position come all the same; they are not believed."""
    telemetry = Telemetry()
    for tenth in range(100):
        now = tenth / 10
        boot = 1000 + 100 * tenth
        telemetry.on_message(
            mavlink.MAVLink_local_position_ned_message(boot, 1, 2, 3, 0, 0, 0), now
        )
        telemetry.on_message(mavlink.MAVLink_attitude_message(boot, 0, 0, 0, 0, 0, 0), now)
        telemetry.on_message(estimator(WELL if tenth < 50 else WELL & ~0x18), now)
        assert telemetry.knows_place(now) == (tenth < 60)


@given(st.integers(0, 0xFFFF), st.floats(), st.floats(), st.integers(0, 2**32 - 1))
def test_whatever_is_measured_is_survived(flags: int, one: float, other: float, bits: int) -> None:
    """Any figures, NaN and infinities among them: texts, and no exception."""
    health = Health()
    for now in (0.0, 2.0):
        health.on_message(estimator(flags, along=one, compass=other), now)
        health.on_message(ekf(flags, compass=one), now)
        health.on_message(shaking(0.0, 0.0, other), now)
        health.on_message(status(bits, bits, ~bits & 0xFFFFFFFF), now)
        health.on_message(battery(flags & 7, bits), now)
    assert all(isinstance(text, str) and text for text in health.faults(2.0))


def test_px4_lists_its_arming_checks_nowhere_but_in_health() -> None:
    """As 1.16.1 does: not yet known, failing, passing; ArduPilot says that it has them."""
    said = [
        status(0, 0, GYRO),
        status(GYRO, GYRO, GYRO),
        status(GYRO, GYRO, GYRO | CHECK),
        status(GYRO | CHECK, GYRO | CHECK, GYRO),
        status(GYRO | CHECK, GYRO | CHECK, GYRO | CHECK),
    ]
    telemetry, heard = Telemetry(), [(PX4().ready(Telemetry()), ArduPilot().ready(Telemetry()))]
    for message in said:
        telemetry.on_message(message, 0.0)
        heard.append((PX4().ready(telemetry), ArduPilot().ready(telemetry)))
    assert [px4 for px4, _ in heard] == [None, None, False, True, False, True]
    assert [ardupilot for _, ardupilot in heard] == [None, None, None, None, False, True]


def report(events: EventReader, *names: str) -> None:
    """A whole report of the arming checks."""
    for name in ("commander_arming_check_summary", *names, "commander_health_summary"):
        events.decode(event_number(name), 3, next(SEQUENCE))


def test_px4_objects_to_what_hold_would_not_mend() -> None:
    """A take-off begins with hold: what only the present mode lacks is no objection to it."""
    telemetry, px4 = Telemetry(), PX4()
    telemetry.altitude = 488.0
    assert px4.objections(telemetry, 0.0) == ["PX4 has not told yet whether its arming checks pass"]
    telemetry.on_message(status(GYRO, GYRO, GYRO), 0.0)
    assert px4.objections(telemetry, 0.0) == ["PX4's arming checks fail"]
    telemetry.custom_mode = 6 << 16
    report(telemetry.events, "check_modes_offboard_signal")
    assert px4.objections(telemetry, 0.0) == []
    report(telemetry.events, "check_modes_offboard_signal", "check_mag_missing")
    assert px4.objections(telemetry, 0.0) == ["compass: missing"]
    telemetry.custom_mode = 4 << 16 | 3 << 24
    report(telemetry.events, "check_modes_offboard_signal")
    assert px4.objections(telemetry, 0.0) == ["its present mode needs setpoints"]


def test_a_report_of_checks_whose_beginning_got_lost_is_none() -> None:
    """What the checks object to is for take-offs; alone, it is no news of a flight."""
    events = EventReader()
    report(events, "check_mag_missing")
    assert events.decode(event_number("check_modes_offboard_signal"), 3, next(SEQUENCE)) is None
    events.decode(event_number("commander_health_summary"), 3, next(SEQUENCE))
    assert events.objections == ("compass: missing",)


def test_events_are_told_in_words_or_not_at_all() -> None:
    """No name of PX4's own reaches people, and nothing of an event without words."""
    assert all("_" not in words and words for words in (*CHECKS.values(), *COMMANDER.values()))
    telemetry = Telemetry()
    names = ("commander_kill_sw_engaged", "commander_failsafe_enter_generic", "no_such_thing")
    for number, name in enumerate(names):
        event = mavlink.mavlink_map[410](0, 0, event_number(name), 0, number, 2, [0] * 40)
        telemetry.on_message(event, 1.0)
    assert telemetry.texts.recent(1.0, 5.0) == ["the kill switch was used"]


def test_what_the_arming_checks_object_to_is_no_text_of_its_own() -> None:
    """It is asked for before a take-off; as alerts of a flight it would be noise."""
    telemetry = Telemetry()
    names = (
        "commander_arming_check_summary",
        "check_modes_offboard_signal",
        "commander_health_summary",
    )
    for number, name in enumerate(names):
        event = mavlink.mavlink_map[410](0, 0, event_number(name), 0, number, 2, [0] * 40)
        telemetry.on_message(event, 1.0)
    assert telemetry.texts.recent(1.0, 5.0) == []
    assert telemetry.events.objections == ("its present mode needs setpoints",)


@pytest.mark.parametrize(
    ("satellites", "fix", "said"),
    [
        (3, 1, "GPS: 3 satellites, 6 are needed; no fix"),
        (1, 3, "GPS: 1 satellite, 6 are needed"),
        (6, 3, ""),
        (255, 1, ""),
    ],
)
def test_too_few_satellites_are_counted(satellites: int, fix: int, said: str) -> None:
    """A number that is not told is no complaint."""
    health = Health()
    assert health.gps_objection == ""
    health.on_message(
        mavlink.MAVLink_gps_raw_int_message(0, fix, 1, 1, 0, 80, 80, 0, 0, satellites), 0.0
    )
    assert health.gps_objection == said


def test_what_px4_acts_for_is_told_before_what_a_mode_lacks() -> None:
    """Its newest findings in flight, and the cause among a failsafe's own arguments."""
    telemetry, px4 = Telemetry(), PX4()
    report(telemetry.events, "check_mag_missing")
    gone = ("check_modes_offboard_signal", "check_mag_missing", "check_gf_violation_custom_gf")
    for name in ("commander_arming_check_summary", *gone, "commander_health_summary"):
        telemetry.events.decode(event_number(name), 3, next(SEQUENCE), (), 100.0)
    assert px4.protection_reasons(telemetry, 101.0, 12.0) == ["its own geofence: outside"]
    arguments = [0] * 40
    arguments[5] = 4
    number = event_number("commander_failsafe_enter")
    sequence = next(SEQUENCE)
    telemetry.on_message(mavlink.mavlink_map[410](0, 0, number, 0, sequence, 2, arguments), 101.0)
    assert px4.protection_reasons(telemetry, 101.0, 12.0)[1] == "battery: critical"
    report(telemetry.events, "check_modes_offboard_signal")
    assert not px4.protection_reasons(telemetry, 200.0, 12.0)


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


def test_a_gap_in_what_is_heard_counts_as_one_second() -> None:
    """Three gaps of ten seconds are three, the fourth four, the fifth more."""
    health = Health()
    health.on_message(gps(3), 0.0)
    for gap in range(1, 6):
        health.on_message(shaking(), 10.0 * gap)
        assert bool(health.faults(10.0 * gap)) is (gap == 5)


def cells_of(cells: list[int], *more: int, number: int = 0) -> Any:  # noqa: ANN401 - pymavlink has no types
    """Cells in millivolts, ten and four."""
    filled = [*cells, *[UNKNOWN] * (10 - len(cells))]
    return mavlink.MAVLink_battery_status_message(
        number, 0, 0, 2000, filled, 0, 0, 0, 50, 0, 1, [*more, *[0] * (4 - len(more))]
    )


def after(*messages: Any) -> Health:  # noqa: ANN401
    """Health after these messages."""
    health = Health()
    for message in messages:
        health.on_message(message, 100.0)
    return health


@pytest.mark.parametrize(
    ("message", "cells"),
    [
        (cells_of([4100, 4090, 4110]), (4.1, 4.09, 4.11)),
        (cells_of([3700] * 10, 3600, 3650), (3.7,) * 10 + (3.6, 3.65)),
        (cells_of([4200]), (4.2,)),
        (cells_of([12600]), None),
        (cells_of([]), None),
    ],
)
def test_cells(message: Any, cells: tuple[float, ...] | None) -> None:  # noqa: ANN401
    """A battery's whole voltage, which stands in the first one's place, is no cell."""
    assert after(message).cells == cells
    assert after(message, cells_of([4000, 3000], number=1)).cells == cells


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
