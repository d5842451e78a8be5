"""The autopilot's clock by TIMESYNC: the swiftest exchange, no nonsense, and a start anew."""

from __future__ import annotations

import pytest
from emulated import Flight, Stepped
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.drivers.mavlink.state.boot_clock import BootClock
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.testing.channel import Impairment

SYSTEM = 7


class Exchanges:
    """A boot clock and an autopilot that was switched on at second `zero` of our clock."""

    def __init__(self, zero: float = -5.0) -> None:
        self.now = 100.0
        self.zero = zero
        self.clock = BootClock(lambda: self.now)

    def ask(self) -> int:
        """Wait until a request is due; its ts1."""
        while (request := self.clock.request(SYSTEM)) is None:
            self.now += 0.05
        assert request.tc1 == 0
        stamp: int = request.ts1
        return stamp

    def hear(self, tc1: int, ts1: int) -> None:
        """A TIMESYNC comes now."""
        self.clock.on_timesync(mavlink.MAVLink_timesync_message(tc1, ts1))

    def exchange(self, up: float, down: float) -> None:
        """One exchange with so many seconds of each way."""
        stamp = self.ask()
        self.now += up
        reading = int((self.now - self.zero) * 1e9)
        self.now += down
        self.hear(reading, stamp)

    @property
    def mistake(self) -> float:
        """Seconds by which it is wrong."""
        told = self.clock.reading(self.now)
        assert told is not None
        return abs(told[0] - (self.now - self.zero))

    @property
    def error(self) -> float:
        """Seconds by which it says that it may be wrong."""
        told = self.clock.reading(self.now)
        assert told is not None
        return told[1]


ways = st.floats(0.0, 0.7)


@given(st.lists(st.tuples(ways, ways), min_size=1, max_size=30))
def test_it_is_never_more_wrong_than_it_says(trips: list[tuple[float, float]]) -> None:
    """Whatever the ways take; and no more than half of the swiftest of late."""
    world = Exchanges()
    for up, down in trips:
        world.exchange(up, down)
        if world.clock.reading(world.now) is not None:
            assert world.mistake <= world.error + 1e-6
    if swift := [up + down for up, down in trips if up + down < 0.99]:
        assert world.error <= min(swift) / 2 + 1e-4 * 320


def test_the_swiftest_counts() -> None:
    """Not the latest, nor the mean."""
    world = Exchanges()
    for up, down in ((0.3, 0.0), (0.01, 0.01), (0.0, 0.4)):
        world.exchange(up, down)
    assert world.mistake < 1e-6
    assert 0.01 <= world.error < 0.0102


def test_it_asks_often_at_first_and_without_answers() -> None:
    """Each second ten times, then every other; four times a second while an answer is missing."""
    world = Exchanges()
    for pause in (0.0, *[1.0] * 9, 2.0, 2.0):
        began = world.now
        world.exchange(0.0, 0.0)
        assert world.now - began == pytest.approx(pause, abs=0.1)
    for pause in (2.0, 2.0, 0.25, 0.25):
        began = world.now
        world.ask()
        assert world.now - began == pytest.approx(pause, abs=0.1)


def test_a_vehicle_that_answered_and_answers_no_more_is_noticed() -> None:
    """Counted from the first request that it left unanswered; one that never answered is not."""
    world = Exchanges()
    world.ask()
    world.now += 60.0
    assert world.clock.unanswered == 0.0
    world.exchange(0.4, 2.0)
    assert world.clock.unanswered == 0.0
    world.ask()
    world.now += 4.0
    assert world.clock.unanswered == pytest.approx(4.0)
    world.exchange(0.0, 0.0)
    assert world.clock.unanswered == 0.0


def test_what_is_no_answer_of_ours() -> None:
    """Another's, an older one's, a request, a second answer, one of no boot clock."""
    world = Exchanges()
    older = world.ask()
    world.now += 1.1
    stamp = world.ask()
    reading = int(105e9)
    year = 1_800_000_000 * 10**9
    for tc1, ts1 in [
        (reading, older),
        (reading, stamp + 1),
        (0, stamp),
        (-5, stamp),
        (year, stamp),
        (0, 12345),
    ]:
        world.hear(tc1, ts1)
        assert world.clock.reading(world.now) is None
    world.hear(int((world.now - world.zero) * 1e9), stamp)
    assert world.mistake < 1e-6
    world.now += 0.5
    world.hear(reading - 10**9, stamp)
    assert world.mistake < 1e-6


def test_one_contradiction_is_doubted_and_two_are_a_start_anew() -> None:
    """A garbled or forged answer changes nothing; an autopilot that starts anew goes on so."""
    world = Exchanges()
    for _ in range(12):
        world.exchange(0.01, 0.01)
    for _ in range(3):
        stamp = world.ask()
        for _ in range(2):
            world.now += 0.01
            world.hear(int((world.now - 40.0) * 1e9), stamp)
        assert world.mistake < 1e-6
        world.exchange(0.01, 0.01)
        assert world.mistake < 1e-6

    world.zero = world.now
    world.exchange(0.01, 0.01)
    assert world.mistake > 100.0
    doubted = world.now
    world.exchange(0.02, 0.02)
    assert world.mistake < 1e-6
    assert world.now - doubted < 2.0


def test_states_tell_its_clock_and_how_surely(flight: Flight) -> None:
    """By exchanges with an emulated vehicle, and anew when that starts anew."""

    def clock(pair: Stepped) -> float:
        return pair.autopilot.firmware.now

    def right(pair: Stepped) -> bool:
        extra = pair.vehicle.read().extra
        near = abs(extra["autopilot_time"] - clock(pair)) < 0.5
        return near and extra.get("autopilot_time_error", 1.0) < 0.5

    with flight() as pair:
        pair.wait(lambda: right(pair))
        pair.autopilot.firmware.now += 100.0
        pair.wait(lambda: pair.vehicle.telemetry.boot_time > 100.0)
        pair.autopilot.restart()
        pair.wait(lambda: pair.vehicle.telemetry.reboots == 1)
        pair.wait(lambda: right(pair))


def test_an_uplink_that_is_lost_alone_is_told(flight: Flight) -> None:
    """The vehicle is heard and answers nothing; as soon as it answers again all is well."""

    def deaf(pair: Stepped) -> bool:
        return any(fault.startswith("link:") for fault in pair.vehicle.read().faults)

    with flight() as pair:
        pair.wait(lambda: "autopilot_time_error" in pair.vehicle.read().extra)
        pair.autopilot.spoil(up=Impairment(loss=1.0))
        pair.wait(lambda: deaf(pair))
        pair.autopilot.spoil(up=Impairment())
        pair.wait(lambda: not deaf(pair))
