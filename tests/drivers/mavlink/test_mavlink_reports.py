"""What is told of a vehicle, and the messages that it is asked for, second by second."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from autopilot import DENIED, STILL
from bench import Bench

from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.vehicle import VehicleMode

STAMPED = {"ATTITUDE", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT"}
NOTHING_NEW = "telemetry: packets come, and say nothing new"


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """A vehicle that stands."""
    made = Bench(monkeypatch)
    made.connect()
    yield made
    made.close()


def test_silence_is_a_loss_after_a_second_and_a_half(bench: Bench) -> None:
    """What was known with the last word goes on to be told, with its age."""
    bench.guide()
    bench.hush()
    assert bench.turn(1.4) is VehicleMode.GUIDED
    assert bench.turn(0.3) is VehicleMode.LOST
    bench.turn(1.3)
    state = bench.vehicle.read()
    assert np.isfinite(state.odometry.position).all()
    assert state.extra["silence"] == pytest.approx(3.0, abs=0.1)


def test_words_without_a_heartbeat_tell_no_mode(bench: Bench) -> None:
    """None for five seconds, or none since the link is back: its mode is not known."""
    bench.fly()
    bench.autopilot.mute = {"HEARTBEAT"}
    assert bench.turn(4.5) is VehicleMode.HOLDING
    assert bench.turn(1.0) is VehicleMode.LOST
    bench.autopilot.mute = set()
    assert bench.turn(0.2) is VehicleMode.HOLDING
    bench.hush()
    bench.turn(2.0)
    bench.hush(off=True)
    bench.autopilot.mute = {"HEARTBEAT"}
    assert bench.turn(0.5) is VehicleMode.LOST
    assert bench.vehicle.preflight() == ["no HEARTBEAT from the vehicle since its link is back"]
    bench.autopilot.mute = set()
    assert bench.turn(0.2) is VehicleMode.HOLDING


def test_standing_motors_need_no_stamps_that_move(bench: Bench) -> None:
    """HEARTBEATs tell of them; while they turn, packets that say nothing new are a loss."""
    bench.autopilot.mute = STAMPED
    assert bench.turn(3.0) is VehicleMode.GROUNDED
    assert NOTHING_NEW not in bench.vehicle.read().faults
    bench.autopilot.mute = set()
    bench.turn(0.2)
    bench.fly()
    bench.autopilot.mute = STAMPED
    assert bench.turn(2.0) is VehicleMode.LOST
    assert NOTHING_NEW in bench.vehicle.read().faults


def test_a_vehicle_that_is_heard_again_finds_itself_within_a_second(bench: Bench) -> None:
    """Until then it is lost, and not accused; then it is one that does not know its place."""
    bench.guide()
    bench.hush()
    bench.turn(2.0)
    bench.hush(off=True)
    bench.autopilot.mute = {"LOCAL_POSITION_NED"}
    assert bench.turn(0.5) is VehicleMode.LOST
    assert bench.vehicle.read().faults == ()
    for _ in range(15):
        bench.vehicle.send(STILL) if bench.vehicle.read().mode is VehicleMode.GUIDED else None
        bench.turn()
    state = bench.vehicle.read()
    assert state.mode is VehicleMode.GUIDED
    assert np.isnan(state.odometry.position).all()


def asked(bench: Bench) -> list[int]:
    """Messages that it was asked for, in order."""
    number = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    return [int(one.param1) for one in bench.autopilot.of("COMMAND_LONG") if one.command == number]


def test_each_message_is_asked_for_once_one_after_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At its own rate: 20 Hz are 50 000 microseconds."""
    bench = Bench(monkeypatch)
    bench.vehicle.connect(5.0)
    bench.turn(2.0)
    assert asked(bench)[: len(PX4.rates)] == list(PX4.rates)
    intervals = {one.param1: one.param2 for one in bench.autopilot.of("COMMAND_LONG")}
    assert intervals[30] == 50_000.0
    bench.close()


def test_a_message_that_stays_out_is_asked_for_again(bench: Bench) -> None:
    """After 3 s and two of its periods, and each five seconds."""
    bench.turn(10.0)
    bench.autopilot.received.clear()
    bench.autopilot.mute = {"SYS_STATUS"}
    bench.turn(3.9)
    assert 1 not in asked(bench)
    bench.turn(1.0)
    assert asked(bench).count(1) == 1
    bench.turn(5.2)
    assert asked(bench).count(1) == 2


def test_while_an_order_is_under_way_no_other_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    """An autopilot takes one at a time; one that is not answered is asked for again later."""
    bench = Bench(monkeypatch)
    bench.autopilot.silent.add(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
    bench.vehicle.connect(5.0)
    first = next(iter(PX4.rates))
    assert set(asked(bench)) == {first}
    bench.autopilot.silent.clear()
    bench.turn(5.0)
    assert set(asked(bench)) >= set(PX4.rates)
    bench.close()


def test_what_it_does_not_have_is_not_asked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Until it starts anew."""
    bench = Bench(monkeypatch)
    bench.autopilot.result = DENIED
    bench.vehicle.connect(5.0)
    bench.turn(20.0)
    before = asked(bench)
    assert len(before) == len(set(before))
    bench.autopilot.start_anew()
    bench.turn(10.0)
    assert sorted(asked(bench)) == sorted(2 * before)
    bench.close()
