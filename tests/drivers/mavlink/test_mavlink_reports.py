"""What is told of a vehicle, and the messages that it is asked for, second by second."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.microservices.commander import Commander
from aerodaas.drivers.mavlink.state.frames import Attitude, LocalFrame
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.state.reporting import VehicleReport
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.state.touchdown import Touchdown
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import LinkCounts
from aerodaas.drivers.mavlink.wire.rates import RateKeeper
from aerodaas.types.clock import NANOSECONDS
from aerodaas.types.vehicle import VehicleMode, VehicleState


class Told:
    """A report on a vehicle whose every word was at 100 s, with a frame that begins 5 m east."""

    def __init__(self, *, armed: bool = True) -> None:
        self.telemetry, self.phase, self.touchdown = Telemetry(), FlightPhase(), Touchdown()
        telemetry = self.telemetry
        telemetry.armed = armed
        telemetry.position = np.array([1.0, 2.0, -3.0])
        telemetry.velocity = np.array([0.1, 0.2, -0.3])
        telemetry.attitude = Attitude(0.1, 0.2, 0.3, 0.4)
        telemetry.boot_time, telemetry.clock = 12.0, 1700.0
        telemetry.back_at = 50.0
        self.hear(100.0)
        self.phase.observe(FlightMode.GUIDED, 100.0, armed=armed, critical=False)
        self.report = VehicleReport(telemetry, self.phase, self.touchdown)
        self.alignment = SimpleNamespace(frame=LocalFrame(np.array([5.0, 0.0, 0.0])), fault="")
        self.report.alignment = self.alignment  # type: ignore[assignment]

    def hear(self, now: float, *, place: bool = True, ticks: bool = True) -> None:
        """It speaks."""
        self.telemetry.heard_at = self.telemetry.beat_at = now
        if ticks:
            self.telemetry.ticked_at = now
        if place:
            self.telemetry.position_at = self.telemetry.attitude_at = now

    def state(self, now: float) -> VehicleState:
        """What is told at `now`, which is a thousand seconds on the mission's clock."""
        return self.report.state(1000 * NANOSECONDS, now, LinkCounts(damaged=3, strangers=4))


def test_what_is_told_in_our_frame() -> None:
    """2 m east of the frame's zero, 1 north, 3 up; its velocity, its attitude, its counts."""
    state = Told().state(100.0)
    assert state.odometry.position == pytest.approx([7.0, 1.0, 3.0])
    assert state.odometry.velocity == pytest.approx([0.2, 0.1, 0.3])
    assert (state.odometry.roll, state.odometry.pitch) == (0.1, 0.2)
    assert (state.odometry.yaw, state.odometry.yaw_rate) == (0.3, 0.4)
    assert (state.mode, state.armed, state.faults) == (VehicleMode.GUIDED, True, ())
    assert state.stamp == 1000 * NANOSECONDS
    assert state.extra == {
        "autopilot_time": 12.0,
        "autopilot_clock": 1700.0,
        "damaged_packets": 3,
        "foreign_packets": 4,
        "impostor_packets": 0,
        "refused_packets": 0,
        "silence": 0.0,
        "gps_fix_type": 0.0,
    }


@pytest.mark.parametrize(("age", "mode"), [(1.5, VehicleMode.GUIDED), (1.75, VehicleMode.LOST)])
def test_silence_is_a_loss_after_a_second_and_a_half(age: float, mode: VehicleMode) -> None:
    """What was known with the last word goes on to be told, with its age."""
    state = Told().state(100.0 + age)
    assert state.mode is mode
    assert state.odometry.position == pytest.approx([7.0, 1.0, 3.0])
    assert state.stamp == (1000 - age) * NANOSECONDS
    assert state.extra["silence"] == age


def test_the_mission_clock_does_not_begin_before_zero() -> None:
    """A state that is older than the mission is of its first moment."""
    told = Told()
    assert told.report.state(NANOSECONDS, 103.0, LinkCounts()).stamp == 0


def test_a_position_is_told_only_where_it_is_known() -> None:
    """Not by a vehicle that speaks of other things, nor without a frame."""
    told = Told()
    told.hear(102.0, place=False)
    blind = told.state(102.0)
    assert np.isnan(blind.odometry.position).all()
    assert blind.mode is VehicleMode.GUIDED
    assert blind.stamp == 1000 * NANOSECONDS
    assert blind.odometry.velocity == pytest.approx([0.2, 0.1, 0.3])
    told = Told()
    told.alignment.frame = None
    assert np.isnan(told.state(100.0).odometry.position).all()
    told.report.alignment = None
    assert np.isnan(told.state(100.0).odometry.position).all()


def test_a_silence_takes_no_position_away() -> None:
    """The last place was told a moment before the last word: it stays until the link is lost."""
    told = Told()
    told.telemetry.position_at = told.telemetry.attitude_at = 99.9
    for hundredth in range(300):
        state = told.state(100.0 + hundredth / 100)
        assert np.isfinite(state.odometry.position).all(), hundredth
    assert told.state(103.0).mode is VehicleMode.LOST


@pytest.mark.parametrize("beat", [None, 94.9])
def test_words_without_a_heartbeat_tell_no_mode(beat: float | None) -> None:
    """None since the link is back, or none for five seconds: its mode is not known."""
    told = Told()
    told.hear(100.1)
    assert told.state(100.1).mode is VehicleMode.GUIDED
    if beat is None:
        told.telemetry.back_at = told.telemetry.beat_at + 0.05
    else:
        told.telemetry.beat_at = beat
    assert told.state(100.1).mode is VehicleMode.LOST
    assert not told.telemetry.in_touch(100.1)


def test_standing_motors_need_no_stamps_that_move() -> None:
    """HEARTBEATs tell of them; while they turn, packets that say nothing new are a loss."""
    for armed, mode in ((False, VehicleMode.GROUNDED), (True, VehicleMode.LOST)):
        told = Told(armed=armed)
        told.hear(102.0, place=False, ticks=False)
        state = told.state(102.0)
        assert state.mode is mode
        words = ("telemetry: packets come, and say nothing new",)
        assert state.faults == (words if armed else ())


@pytest.mark.parametrize(("since", "told_so"), [(1.5, False), (1.75, True)])
def test_a_vehicle_that_is_just_heard_again_is_not_accused(since: float, *, told_so: bool) -> None:
    """It has a second and a half to say something new."""
    told = Told()
    told.telemetry.back_at = 110.0 - since
    told.hear(110.0, place=False, ticks=False)
    assert ("telemetry: packets come, and say nothing new" in told.state(110.0).faults) is told_so


@pytest.mark.parametrize(("since", "lost"), [(0.75, True), (1.0, False)])
def test_a_vehicle_that_is_heard_again_finds_itself_within_a_second(
    since: float, *, lost: bool
) -> None:
    """Until then it is lost, if its motors turn and it does not know its place."""
    told = Told()
    told.telemetry.back_at = 110.0 - since
    told.hear(110.0, place=False)
    assert told.report.lost(110.0) is lost
    told.hear(110.0)
    assert not told.report.lost(110.0)
    told.hear(110.0, place=False)
    told.telemetry.armed = False
    assert not told.report.lost(110.0)


@pytest.mark.parametrize(
    ("departure", "taken", "falling", "mode"),
    [
        (None, None, False, VehicleMode.GUIDED),
        ((False, False), None, False, VehicleMode.GUIDED),
        ((True, False), None, False, VehicleMode.LANDING),
        ((False, True), None, False, VehicleMode.TAKING_OFF),
        ((True, True), None, False, VehicleMode.LANDING),
        ((True, True), VehicleMode.MANUAL, False, VehicleMode.MANUAL),
        ((True, True), VehicleMode.MANUAL, True, VehicleMode.FAILSAFE),
    ],
)
def test_whose_word_counts_for_its_mode(
    departure: tuple[bool, bool] | None,
    taken: VehicleMode | None,
    mode: VehicleMode,
    *,
    falling: bool,
) -> None:
    """A fall before all, then who has taken it, then our take-offs, then its own HEARTBEATs."""
    told = Told()
    if departure is not None:
        made: Any = SimpleNamespace(withdrawing=departure[0], climbs=departure[1])
        told.report.departure = made
    told.phase.taken, told.touchdown.falling = taken, falling
    assert told.report.mode is mode


def test_faults_in_their_order_and_once() -> None:
    """A restart, a fall, its position, its health, its texts of the last 12 s that are grave."""
    told = Told()
    told.report.restarted, told.touchdown.fault = "restarted", "fell"
    told.alignment.fault = "jumped"
    texts = told.telemetry.texts
    texts.add("too old", 3, 87.9)
    texts.add("grave", 3, 88.0)
    texts.add("a warning", 4, 99.0)
    texts.add("fell", 2, 99.0)
    for now in (98.0, 99.0):
        told.telemetry.health.take(
            mavlink.MAVLink_battery_status_message(
                0, 0, 0, 0, [0] * 10, 0, 0, 0, 50, 0, 2, [0] * 4, 0, 0
            ),
            now,
        )
    assert told.state(100.0).faults == ("restarted", "fell", "jumped", "battery: low", "grave")


class Kept:
    """The messages that an ArduPilot is asked for; it answers each order as it is told."""

    def __init__(self) -> None:
        self.now = 100.0
        self.sent: list[tuple[float, int, float]] = []
        self.commander = Commander(self._heard, (1, 1), 245)
        self.telemetry = Telemetry()
        self.keeper = RateKeeper(ArduPilot(), self.commander)
        self.result: int | None = mavlink.MAV_RESULT_ACCEPTED
        self.silent: set[int] = set()

    def _heard(self, order: Any) -> None:  # noqa: ANN401
        self.sent.append((round(self.now, 3), int(order.param1), order.param2))

    def run(self, seconds: float) -> list[int]:
        """Time passes, in which it sends what it was asked for; what it is asked for anew."""
        before = len(self.sent)
        for _ in range(round(10 * seconds)):
            self.now = round(self.now + 0.1, 6)
            for message in {number for _, number, _ in self.sent} - self.silent:
                self.telemetry.seen[mavlink.mavlink_map[message].msgname] = self.now
            self.keeper.turn(self.telemetry, self.now)
            number = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
            if self.result is not None and self.commander.under_way(number):
                ack = mavlink.MAVLink_command_ack_message(number, self.result, 0, 0, 245, 1)
                self.commander.take(ack, self.now)
            self.commander.turn(self.now)
        return [number for _, number, _ in self.sent[before:]]


def test_each_message_is_asked_for_once_one_after_the_other() -> None:
    """At its own rate: 20 Hz are 50 000 microseconds."""
    kept = Kept()
    kept.telemetry.seen["ATTITUDE"] = 100.0
    assert kept.run(2.0) == list(ArduPilot.rates)
    assert [at for at, _, _ in kept.sent] == pytest.approx(
        [100.1 + index / 10 for index in range(len(ArduPilot.rates))]
    )
    assert (30, 50_000.0) in {(number, interval) for _, number, interval in kept.sent}
    assert kept.run(60.0) == []


def test_a_message_that_stays_out_is_asked_for_again() -> None:
    """After 3 s and two of its periods, and each five seconds; others are not."""
    kept = Kept()
    kept.run(10.0)
    kept.silent = {1}
    assert kept.run(4.0) == []
    assert kept.run(0.2) == [1], "SYS_STATUS comes twice a second: 3 s and one"
    assert kept.run(4.7) == []
    assert kept.run(0.3) == [1]


def test_while_an_order_is_under_way_no_other_is_given() -> None:
    """An autopilot takes one at a time; one that is not answered is asked for again later."""
    kept = Kept()
    kept.result = None
    first = next(iter(ArduPilot.rates))
    assert set(kept.run(5.5)) == {first}
    kept.result = mavlink.MAV_RESULT_ACCEPTED
    assert {first, *kept.run(3.0)} == set(ArduPilot.rates)


def test_what_it_does_not_have_is_not_asked_for_again() -> None:
    """Until it starts anew; what was not answered is."""
    kept = Kept()
    kept.result = mavlink.MAV_RESULT_DENIED
    kept.silent = set(ArduPilot.rates)
    assert len(kept.run(60.0)) == len(ArduPilot.rates)
    kept.telemetry.reboots = 1
    assert len(kept.run(60.0)) == len(ArduPilot.rates)
    kept = Kept()
    kept.result, kept.silent = None, set(ArduPilot.rates)
    kept.run(6.5)
    kept.result = mavlink.MAV_RESULT_ACCEPTED
    first = next(iter(ArduPilot.rates))
    assert first in kept.run(10.0)


def test_an_autopilot_that_starts_anew_is_asked_for_all_of_them() -> None:
    """At once, whatever it has sent a moment ago."""
    kept = Kept()
    kept.run(10.0)
    kept.telemetry.reboots = 1
    assert sorted(kept.run(2.0)) == sorted(ArduPilot.rates)
