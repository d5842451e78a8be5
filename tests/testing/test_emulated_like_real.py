"""The emulated autopilots say in each situation what the real ones were seen to say."""

from __future__ import annotations

from typing import Any

import pytest
from autopilot_facts import ACKS, FACTS, VERSIONS

from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.microservices.commander import PendingCommand
from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink as mav
from tools.mavlink_vehicle import AutopilotOptions
from tools.mavlink_vehicle.ardupilot import EmulatedArduPilot
from tools.mavlink_vehicle.firmware import Firmware
from tools.mavlink_vehicle.flight import MavFlight
from tools.mavlink_vehicle.px4 import EmulatedPX4

STEP = 0.05
HEIGHT = 8.0
ORDERS = {"arm": (1.0, 0.0), "disarm": (0.0, 0.0), "kill": (0.0, 21196.0)}
ESTIMATORS = {
    "px4": mav.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    "ardupilot": mav.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
}


class Bench:
    """A firmware without a link: what it says is kept."""

    def __init__(self, family: str) -> None:
        self.said: list[Any] = []
        options = AutopilotOptions(family="px4" if family == "px4" else "ardupilot")
        kind = EmulatedPX4 if family == "px4" else EmulatedArduPilot
        self.family = family
        self.dialect = PX4() if family == "px4" else ArduPilot()
        self.firmware: Firmware = kind(options, MavFlight(options), self.said.append)

    def pass_time(self, seconds: float) -> None:
        """Let it fly on."""
        for _ in range(round(seconds / STEP)):
            self.firmware.advance(STEP)

    def order(self, name: str) -> int:
        """Arm, disarm or kill; what it acknowledges."""
        first, second = ORDERS[name]
        values = (first, second, 0.0, 0.0, 0.0, 0.0, 0.0)
        return int(self.firmware.obey(mav.MAV_CMD_COMPONENT_ARM_DISARM, values, None))

    def take_off(self) -> None:
        """As our driver does it."""
        telemetry = Telemetry()
        message = self.firmware.message(mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
        assert message is not None
        telemetry.on_message(message, 0.0)
        for order in self.dialect.take_off(HEIGHT, telemetry):
            self.give(order)

    def give(self, order: PendingCommand) -> None:
        """Have it obey."""
        values = tuple(float(value) for value in order.values)
        assert self.firmware.obey(order.number, values, order.frame) == mav.MAV_RESULT_ACCEPTED

    def fly(self) -> None:
        """Up, and holding."""
        self.pass_time(1.0)
        self.take_off()
        self.pass_time(15.0)
        self.give(self.dialect.ask_mode(FlightMode.HOLD))
        self.pass_time(0.5)

    def enter(self, situation: str) -> None:
        """Bring it there."""
        if situation == "starting":
            self.pass_time(0.2)
        elif situation == "ready":
            self.pass_time(1.0)
        elif situation == "told to land 0.3 s after arming":
            self.pass_time(1.0)
            self.take_off()
            self.pass_time(0.3)
            self.give(self.dialect.ask_mode(FlightMode.LAND))
            self.pass_time(5.0)
        else:
            self.fly()
            self.break_(situation)

    def break_(self, situation: str) -> None:
        """Let what the situation is called happen to it in the air."""
        if situation == "motors killed in the air":
            assert self.order("kill") == mav.MAV_RESULT_ACCEPTED
            self.pass_time(0.1)
        elif situation == "terminated in the air":
            self.firmware.obey(mav.MAV_CMD_DO_FLIGHTTERMINATION, (1.0,) + (0.0,) * 6, None)
            self.pass_time(4.0)
        elif situation == "restarted in the air":
            self.firmware.restart()
        elif situation == "setpoints stopped for 3 s":
            still = mav.MAV_FRAME_LOCAL_NED, 0b110111000111, *(0.0,) * 11
            message = mav.MAVLink_set_position_target_local_ned_message(0, 1, 1, *still)
            self.firmware.setpoint(message)
            self.give(self.dialect.ask_mode(FlightMode.GUIDED))
            self.pass_time(3.0)
        elif situation.startswith("GPS lost for "):
            self.firmware.lose_gps()
            self.pass_time(float(situation.split()[3]))


@pytest.mark.parametrize(("family", "situation"), FACTS)
def test_what_it_says_in_a_situation(family: str, situation: str) -> None:
    """HEARTBEAT, SYS_STATUS, EXTENDED_SYS_STATE, GPS_RAW_INT and the estimator's report."""
    fact, bench = FACTS[family, situation], Bench(family)
    bench.enter(situation)
    firmware = bench.firmware
    beat = firmware.heartbeat()
    assert bool(beat.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED) is fact.armed
    assert fact.state in {None, beat.system_status}
    assert fact.mode in {None, beat.custom_mode}
    landed = firmware.message(mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    status = firmware.message(mav.MAVLINK_MSG_ID_SYS_STATUS)
    gps = firmware.message(mav.MAVLINK_MSG_ID_GPS_RAW_INT)
    estimator = firmware.message(ESTIMATORS[family])
    assert landed is not None
    assert status is not None
    assert gps is not None
    assert estimator is not None
    assert landed.landed_state == fact.landed
    present = status.onboard_control_sensors_present
    health = status.onboard_control_sensors_health
    assert present & fact.present == fact.present
    assert present & fact.absent == 0
    assert health & fact.healthy == fact.healthy
    assert health & fact.sick == 0
    assert estimator.flags & fact.estimator == fact.estimator
    assert estimator.flags & fact.lost == 0
    assert fact.fix in {None, gps.fix_type}


@pytest.mark.parametrize(("patience", "leaves"), [(1.0, True), (4.0, False)])
def test_px4_waits_for_setpoints_as_its_parameter_says(patience: float, leaves: bool) -> None:  # noqa: FBT001
    """COM_OF_LOSS_T, in seconds."""
    bench = Bench("px4")
    bench.firmware.parameters.values["COM_OF_LOSS_T"] = patience
    bench.enter("setpoints stopped for 3 s")
    assert bench.firmware.failsafe is leaves


@pytest.mark.parametrize(("family", "situation", "order"), ACKS)
def test_what_it_acknowledges(family: str, situation: str, order: str) -> None:
    """The same result as the real one's."""
    bench = Bench(family)
    bench.enter(situation)
    assert bench.order(order) == ACKS[family, situation, order]


@pytest.mark.parametrize("family", VERSIONS)
def test_its_version(family: str) -> None:
    """That of the autopilot which was recorded."""
    bench = Bench(family)
    number = float(mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    bench.firmware.obey(mav.MAV_CMD_REQUEST_MESSAGE, (number,) + (0.0,) * 6, None)
    version = bench.said[-1].flight_sw_version
    assert tuple(version >> shift & 0xFF for shift in (24, 16, 8)) == VERSIONS[family]


@pytest.mark.parametrize("family", ["px4", "ardupilot"])
def test_a_place_that_drifted_is_put_right_when_gps_comes_back(family: str) -> None:
    """Its local position goes astray meanwhile, and jumps."""
    bench = Bench(family)
    bench.fly()
    before = bench.firmware.flight.ned
    bench.firmware.lose_gps()
    bench.pass_time(12.0)
    astray = bench.firmware.flight.ned
    assert abs(astray[1] - before[1]) > 1.0
    bench.firmware.lose_gps(off=True)
    assert bench.firmware.flight.ned[:2] == pytest.approx(before[:2], abs=0.5)
