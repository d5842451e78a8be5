"""What is wrong, by its name; and the arming checks as each autopilot tells them."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.microservices.event_words import CHECKS, COMMANDER
from aerodaas.drivers.mavlink.microservices.events import EventReader, event_number
from aerodaas.drivers.mavlink.state.health import Health
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink

CHECK, GPS = mavlink.MAV_SYS_STATUS_PREARM_CHECK, mavlink.MAV_SYS_STATUS_SENSOR_GPS
GYRO = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
SEQUENCE = itertools.count()
WELL = 0x3F
"""Attitude, velocities and positions of the estimator."""


def gps(fix: int) -> Any:  # noqa: ANN401 - pymavlink has no types
    """A GPS with this kind of fix."""
    return mavlink.MAVLink_gps_raw_int_message(0, fix, 1, 1, 0, 80, 80, 0, 0, 9)


def estimator(flags: int = WELL, unsure: float = 0.5, compass: float = 0.1) -> Any:  # noqa: ANN401
    """PX4's estimator."""
    return mavlink.MAVLink_estimator_status_message(
        0, flags, 0.1, 0.1, 0.1, compass, 0.0, 0.0, unsure, 0.4
    )


def ekf(flags: int = WELL, compass: float = 0.1) -> Any:  # noqa: ANN401
    """ArduPilot's estimator."""
    return mavlink.MAVLink_ekf_status_report_message(flags, 0.1, 0.1, 0.1, compass, 0.0)


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


def shaking(z: float, clipped: int = 0) -> Any:  # noqa: ANN401
    """How it shakes."""
    return mavlink.MAVLink_vibration_message(0, 1.0, 1.0, z, clipped, 0, 0)


@pytest.mark.parametrize(
    ("well", "ill", "words"),
    [
        (gps(3), gps(1), "GPS: no fix"),
        (gps(3), gps(0), "GPS: no fix"),
        (gps(3), gps(2), "GPS: a fix in the plane only"),
        (estimator(), estimator(unsure=12.0), "estimator: position unsure by more than 10 m"),
        (estimator(), estimator(WELL & ~0x18), "estimator: no position along the ground"),
        (estimator(0x3FF), estimator(0x365), "estimator: no position along the ground"),
        (ekf(), ekf(WELL | 128), "estimator: no position along the ground"),
        (
            estimator(),
            estimator(WELL | 1024),
            "estimator: GPS positions jump, and are not believed",
        ),
        (estimator(), estimator(WELL & ~1), "estimator: attitude unknown"),
        (
            estimator(),
            estimator(compass=1.2),
            "estimator: what is measured of its compass does not fit",
        ),
        (ekf(), ekf(WELL & ~0x18), "estimator: no position along the ground"),
        (ekf(), ekf(WELL | 1 << 15), "estimator: GPS positions jump, and are not believed"),
        (ekf(), ekf(compass=0.9), "estimator: what is measured of its compass does not fit"),
        (battery(1), battery(2), "battery: low"),
        (battery(1), battery(3, 16), "battery: critical, too hot"),
        (battery(1, number=1), battery(0, 4, number=1), "battery 2: a cell has failed"),
        (shaking(5.0), shaking(45.0), "vibration: more than 30 m/s²"),
        (status(GYRO, GYRO, GYRO), status(GYRO, GYRO, 0), "gyroscope: unhealthy"),
        (status(GPS, GPS, GPS), status(GPS, GPS, 0), "GPS: unhealthy"),
    ],
)
def test_what_is_wrong_is_told_by_its_name(well: Any, ill: Any, words: str) -> None:  # noqa: ANN401
    """Once it has been so for a second, until it is well again; nothing before."""
    health = Health()
    for second, message in enumerate((well, well, ill)):
        health.take(message, float(second))
        assert health.faults(second) == []
    health.take(ill, 3.5)
    assert health.faults(3.5) == [words]
    health.take(well, 4.0)
    assert health.faults(4.0) == []


def test_clipping_is_told_while_it_grows() -> None:
    """A count that stands still is of the past."""
    health = Health()
    for second, count in enumerate((500, 500, 560, 620, 680)):
        health.take(shaking(1.0, count), float(second))
    assert health.faults(4.0) == ["vibration: beyond what the accelerometers measure"]
    health.take(shaking(1.0, 680), 5.0)
    assert health.faults(5.0) == []


def test_a_gps_that_says_nothing_more() -> None:
    """Silence is told, too; one that never had a fix is not missed."""
    health = Health()
    assert health.faults(100.0) == []
    health.take(gps(0), 100.0)
    others_speak(health, 100.0, 120.0)
    assert health.faults(120.0) == []
    health.take(gps(3), 121.0)
    others_speak(health, 121.0, 124.9)
    assert health.faults(124.9) == []
    others_speak(health, 124.9, 125.5)
    assert health.faults(125.5) == ["GPS: it has fallen silent"]


def others_speak(health: Health, since: float, until: float) -> None:
    """Ten messages a second that say nothing of the GPS."""
    for tenth in range(int(since * 10) + 1, int(until * 10) + 1):
        health.take(shaking(1.0), tenth / 10)


def test_a_link_that_is_cut_is_no_silent_gps() -> None:
    """While nothing is heard, and in the first moments after, the GPS is not blamed."""
    health = Health()
    health.take(gps(3), 10.0)
    assert health.faults(40.0) == []
    health.take(shaking(1.0), 40.0)
    assert health.faults(40.5) == []
    others_speak(health, 40.0, 44.0)
    assert health.faults(44.0) == ["GPS: it has fallen silent"]


def test_sensors_that_are_not_there_or_not_used_are_not_ill() -> None:
    """Only what is present and enabled can be unhealthy."""
    health = Health()
    for second in range(4):
        health.take(status(0, GYRO, 0), float(second))
        health.take(status(GPS, 0, 0), float(second))
    assert health.faults(4.0) == []


def test_what_grows_slowly_is_told_in_steps() -> None:
    """A text that changed with every metre would be told with every metre."""
    health = Health()
    told = set()
    for tenth in range(1200):
        health.take(estimator(unsure=tenth / 10), tenth / 10)
        told |= set(health.faults(tenth / 10))
    assert len(told) == 5


def test_an_estimator_that_is_lost_leaves_no_position() -> None:
    """Packets with a position come all the same; they are not believed."""
    telemetry = Telemetry()
    for tenth in range(100):
        now = tenth / 10
        boot = 1000 + 100 * tenth
        telemetry.take(mavlink.MAVLink_local_position_ned_message(boot, 1, 2, 3, 0, 0, 0), now)
        telemetry.take(mavlink.MAVLink_attitude_message(boot, 0, 0, 0, 0, 0, 0), now)
        telemetry.take(estimator(WELL if tenth < 50 else WELL & ~0x18), now)
        assert telemetry.knows_place(now) == (tenth < 60)


@given(st.integers(0, 0xFFFF), st.floats(), st.floats(), st.integers(0, 2**32 - 1))
def test_whatever_is_measured_is_survived(flags: int, one: float, other: float, bits: int) -> None:
    """Any figures, NaN and infinities among them: texts, and no exception."""
    health = Health()
    for now in (0.0, 2.0):
        health.take(estimator(flags, one, other), now)
        health.take(ekf(flags, one), now)
        health.take(shaking(other), now)
        health.take(status(bits, bits, ~bits & 0xFFFFFFFF), now)
        health.take(battery(flags & 7, bits), now)
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
        telemetry.take(message, 0.0)
        heard.append((PX4().ready(telemetry), ArduPilot().ready(telemetry)))
    assert [px4 for px4, _ in heard] == [None, None, False, True, False, True]
    assert [ardupilot for _, ardupilot in heard] == [None, None, None, None, False, True]


def report(events: EventReader, *names: str) -> None:
    """A whole report of the arming checks."""
    for name in ("commander_arming_check_summary", *names, "commander_health_summary"):
        events.take(event_number(name), 3, next(SEQUENCE))


def test_px4_objects_to_what_hold_would_not_mend() -> None:
    """A take-off begins with hold: what only the present mode lacks is no objection to it."""
    telemetry, px4 = Telemetry(), PX4()
    telemetry.altitude = 488.0
    assert px4.objections(telemetry, 0.0) == ["PX4 has not told yet whether its arming checks pass"]
    telemetry.take(status(GYRO, GYRO, GYRO), 0.0)
    assert px4.objections(telemetry, 0.0) == ["PX4's arming checks fail"]
    telemetry.custom_mode = 6 << 16
    report(telemetry.events, "check_modes_offboard_signal")
    assert px4.objections(telemetry, 0.0) == []
    report(telemetry.events, "check_modes_offboard_signal", "check_mag_missing")
    assert px4.objections(telemetry, 0.0) == ["compass: missing"]
    telemetry.custom_mode = 4 << 16 | 3 << 24
    report(telemetry.events, "check_modes_offboard_signal")
    assert px4.objections(telemetry, 0.0) == ["its present mode needs setpoints"]


@pytest.mark.parametrize(("charge", "told"), [(2, "battery: low"), (0, "battery: unhealthy")])
def test_a_battery_that_speaks_for_itself_is_told_once(charge: int, told: str) -> None:
    """A low one is unhealthy to its autopilot, too; that is news only where nobody says why."""
    health = Health()
    bit = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    for second in range(4):
        health.take(battery(charge), float(second))
        health.take(status(bit, bit, 0), float(second))
    assert health.faults(4.0) == [told]


def test_a_report_of_checks_whose_beginning_got_lost_is_none() -> None:
    """What the checks object to is for take-offs; alone, it is no news of a flight."""
    events = EventReader()
    report(events, "check_mag_missing")
    assert events.take(event_number("check_modes_offboard_signal"), 3, next(SEQUENCE)) is None
    events.take(event_number("commander_health_summary"), 3, next(SEQUENCE))
    assert events.objections == ("compass: missing",)


def test_events_are_told_in_words_or_not_at_all() -> None:
    """No name of PX4's own reaches people, and nothing of an event without words."""
    assert all("_" not in words and words for words in (*CHECKS.values(), *COMMANDER.values()))
    telemetry = Telemetry()
    names = ("commander_kill_sw_engaged", "commander_failsafe_enter_generic", "no_such_thing")
    for number, name in enumerate(names):
        event = mavlink.mavlink_map[410](0, 0, event_number(name), 0, number, 2, [0] * 40)
        telemetry.take(event, 1.0)
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
        telemetry.take(event, 1.0)
    assert telemetry.texts.recent(1.0, 5.0) == []
    assert telemetry.events.objections == ("its present mode needs setpoints",)


def test_an_autopilot_that_is_found_starting_has_not_started_anew() -> None:
    """Only a start after it was heard to be up is one."""
    telemetry, reboots = Telemetry(), []
    for state in (mavlink.MAV_STATE_BOOT, mavlink.MAV_STATE_STANDBY, mavlink.MAV_STATE_BOOT):
        telemetry.take(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, state, 3), 0.0)
        reboots.append(telemetry.reboots)
    assert reboots == [0, 0, 1]


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
    health.take(mavlink.MAVLink_gps_raw_int_message(0, fix, 1, 1, 0, 80, 80, 0, 0, satellites), 0.0)
    assert health.gps_objection == said


def test_a_place_of_zeros_is_none() -> None:
    """An autopilot without GPS sends zeros."""
    telemetry, places = Telemetry(), []
    for boot, degrees in ((1, 10), (2, 0)):
        telemetry.take(
            mavlink.MAVLink_global_position_int_message(boot, degrees, degrees, 5, 0, 0, 0, 0, 0),
            0.0,
        )
        places.append(telemetry.place)
    assert places == [(1e-6, 1e-6), None]


def test_what_px4_acts_for_is_told_before_what_a_mode_lacks() -> None:
    """Its newest findings in flight, and the cause among a failsafe's own arguments."""
    telemetry, px4 = Telemetry(), PX4()
    report(telemetry.events, "check_mag_missing")
    gone = ("check_modes_offboard_signal", "check_mag_missing", "check_gf_violation_custom_gf")
    for name in ("commander_arming_check_summary", *gone, "commander_health_summary"):
        telemetry.events.take(event_number(name), 3, next(SEQUENCE), (), 100.0)
    assert px4.protection_reasons(telemetry, 101.0, 12.0) == ["its own geofence: outside"]
    arguments = [0] * 40
    arguments[5] = 4
    number = event_number("commander_failsafe_enter")
    sequence = next(SEQUENCE)
    telemetry.take(mavlink.mavlink_map[410](0, 0, number, 0, sequence, 2, arguments), 101.0)
    assert px4.protection_reasons(telemetry, 101.0, 12.0)[1] == "battery: critical"
    report(telemetry.events, "check_modes_offboard_signal")
    assert not px4.protection_reasons(telemetry, 200.0, 12.0)
