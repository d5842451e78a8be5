"""A take-off order by order: what is sent when, what ends it, and what is taken back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from autopilot import (
    ACCEPTED,
    ARM,
    DENIED,
    MODE,
    RISE,
    SETPOINT,
    ScriptedAutopilot,
    acknowledgement,
)
from bench import Bench

from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.messages.vehicle import VehicleMode

HOLD, LAND, TAKE_OFF = FlightMode.HOLD, FlightMode.LAND, FlightMode.TAKE_OFF


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """A PX4 on the ground that acknowledges nothing by itself."""
    made = Bench(monkeypatch)
    made.connect()
    made.autopilot.result = None
    yield made
    made.close()


def answer(bench: Bench, number: int, result: int = ACCEPTED) -> None:
    """Acknowledge an order."""
    bench.autopilot.say(acknowledgement(number, result))
    bench.turn(0.1)


def climb(bench: Bench, height: float = 3.0) -> None:
    """As far as the climb itself: in hold, armed, and told to rise."""
    bench.vehicle.take_off(height)
    answer(bench, MODE)
    bench.autopilot.mode = HOLD
    answer(bench, ARM)
    bench.autopilot.armed = True
    bench.turn(0.1)
    assert bench.autopilot.orders() == [MODE, ARM, RISE]


def disarms(bench: Bench) -> int:
    """How often it was told to stop its motors."""
    commands = bench.autopilot.of("COMMAND_LONG")
    return sum(one.command == ARM and one.param1 == 0.0 for one in commands)


def refusal(bench: Bench) -> str:
    """Why the next take-off is refused."""
    with pytest.raises(VehicleError) as refused:
        bench.vehicle.take_off(3.0)
    return str(refused.value)


def test_each_order_waits_for_the_one_before(bench: Bench) -> None:
    """The mode, the motors, the climb to 3 m above the 488 m at which it stands."""
    bench.vehicle.take_off(3.0)
    bench.turn(0.5)
    assert bench.autopilot.orders() == [MODE]
    answer(bench, MODE)
    assert bench.autopilot.orders() == [MODE, ARM]
    answer(bench, ARM)
    assert bench.autopilot.orders() == [MODE, ARM, RISE]
    assert bench.autopilot.of("COMMAND_INT")[0].z == 491.0
    assert bench.turn() is VehicleMode.TAKING_OFF


def test_what_shows_to_be_done_needs_no_acknowledgement(bench: Bench) -> None:
    """The mode by HEARTBEAT, the motors by HEARTBEAT, the climb by having lifted."""
    bench.vehicle.take_off(3.0)
    bench.turn(0.1)
    bench.autopilot.mode = HOLD
    bench.turn(0.2)
    assert bench.autopilot.orders() == [MODE, ARM]
    bench.autopilot.armed = True
    bench.turn(0.2)
    assert bench.autopilot.orders() == [MODE, ARM, RISE]
    bench.turn(1.1)
    assert bench.autopilot.orders() == [MODE, ARM, RISE, RISE], "it has not lifted"
    bench.autopilot.mode = TAKE_OFF
    bench.autopilot.landed = mavlink.MAV_LANDED_STATE_IN_AIR
    bench.turn(3.0)
    assert bench.autopilot.orders() == [MODE, ARM, RISE, RISE]
    assert bench.turn() is VehicleMode.TAKING_OFF, "it still rises"


@pytest.mark.parametrize(
    ("height", "up", "rise", "done"),
    [
        (3.0, 2.6, 0.0, False),
        (3.0, 2.8, 0.0, True),
        (3.0, 2.9, 0.4, False),
        (3.0, 2.9, -0.4, False),
        (3.0, 3.9, 2.0, False),
        (3.0, 4.1, 2.0, True),
        (1.0, 0.7, 0.0, False),
        (1.0, 0.9, 0.0, True),
    ],
)
def test_when_a_climb_is_done(
    monkeypatch: pytest.MonkeyPatch, height: float, up: float, rise: float, *, done: bool
) -> None:
    """Within a tenth (at least 0.2 m) below, no faster than 0.3 m/s; or a metre above it."""
    bench = Bench(monkeypatch, ScriptedAutopilot("ardupilot"))
    bench.connect()
    bench.vehicle.take_off(height)
    bench.autopilot.mode = FlightMode.GUIDED
    bench.turn(0.2)
    bench.lift()
    bench.autopilot.velocity = np.array([0.0, 0.0, -2.0])
    for _ in range(round(10 * up)):
        bench.autopilot.position = bench.autopilot.position - np.array([0.0, 0.0, 0.1])
        bench.turn()
    bench.autopilot.velocity = np.array([0.0, 0.0, -rise])
    assert bench.turn(0.1) is (VehicleMode.GUIDED if done else VehicleMode.TAKING_OFF)
    bench.close()


def test_motors_that_do_not_start_within_twenty_seconds(bench: Bench) -> None:
    """Told with the autopilot's own words; no order to start them is left."""
    bench.autopilot.result = ACCEPTED
    bench.vehicle.take_off(3.0)
    assert bench.turn(19.5) is VehicleMode.TAKING_OFF
    bench.autopilot.say(mavlink.MAVLink_statustext_message(3, b"compass: missing", 0, 0))
    assert bench.turn(1.0) is VehicleMode.LANDING
    assert "it did not start its motors; compass: missing" in refusal(bench)
    assert disarms(bench) == 1


def test_a_refused_order_to_arm_is_taken_back(bench: Bench) -> None:
    """Hold, in which a late one does no harm, and motors off; then it rests."""
    bench.autopilot.result = ACCEPTED
    bench.autopilot.answers[ARM] = lambda one: [
        acknowledgement(ARM, DENIED if one.param1 else ACCEPTED)
    ]
    bench.vehicle.take_off(3.0)
    assert bench.turn(0.5) is VehicleMode.LANDING
    assert bench.autopilot.orders() == [MODE, ARM, MODE, ARM]
    assert bench.autopilot.modes() == [HOLD, HOLD]
    assert disarms(bench) == 1
    assert bench.turn(2.0) is VehicleMode.GROUNDED
    assert "arm: denied" in refusal(bench)


@pytest.mark.parametrize("shows", [True, False])
def test_a_refusal_of_what_was_sent_twice_is_doubted(bench: Bench, *, shows: bool) -> None:
    """The first may have been done, and the refusal mean the second: three seconds to show it."""
    bench.vehicle.take_off(3.0)
    answer(bench, MODE)
    bench.autopilot.mode = HOLD
    bench.turn(1.1)
    assert bench.autopilot.orders() == [MODE, ARM, ARM]
    answer(bench, ARM, DENIED)
    assert bench.turn(2.5) is VehicleMode.TAKING_OFF
    assert bench.autopilot.orders() == [MODE, ARM, ARM]
    bench.autopilot.armed = shows
    mode = bench.turn(1.0)
    assert mode is (VehicleMode.TAKING_OFF if shows else VehicleMode.LANDING)
    assert bench.autopilot.orders()[3] == (RISE if shows else MODE)
    assert disarms(bench) == (not shows)


def test_called_off_before_motors_it_is_over_at_once(bench: Bench) -> None:
    """An order that starts no motors needs no taking back, and nothing of it is repeated."""
    bench.vehicle.take_off(3.0)
    assert bench.turn() is VehicleMode.TAKING_OFF
    bench.vehicle.land()
    assert bench.vehicle.read().mode is VehicleMode.GROUNDED
    answer(bench, MODE)
    bench.turn(5.0)
    assert bench.autopilot.orders() == [MODE]


def test_called_off_in_the_air_it_is_landed(bench: Bench) -> None:
    """No motor is stopped, and no climb ordered further."""
    climb(bench)
    bench.autopilot.landed = mavlink.MAV_LANDED_STATE_IN_AIR
    bench.rise(1.0)
    bench.autopilot.received.clear()
    bench.vehicle.land()
    bench.autopilot.mode = TAKE_OFF
    assert bench.turn(1.5) is VehicleMode.LANDING, "the modes of a take-off may still show"
    assert set(bench.autopilot.modes()) == {LAND}
    assert set(bench.autopilot.orders()) == {MODE}


@pytest.mark.parametrize("shown", [TAKE_OFF, HOLD, FlightMode.GUIDED])
def test_the_modes_of_a_take_off_are_no_pilots_while_it_is_taken_back(
    bench: Bench, shown: FlightMode
) -> None:
    """Any other is, and who has taken it over is left alone: nothing is repeated either."""
    climb(bench)
    bench.vehicle.land()
    bench.autopilot.mode = shown
    assert bench.turn(1.0) is VehicleMode.LANDING
    bench.autopilot.mode = FlightMode.RETURN
    assert bench.turn(0.2) is VehicleMode.MANUAL
    before = len(bench.autopilot.orders())
    bench.turn(5.0)
    assert len(bench.autopilot.orders()) == before


def test_whoever_takes_over_is_left_alone(bench: Bench) -> None:
    """Neither is the climb ordered further, nor anything taken back."""
    climb(bench)
    answer(bench, RISE)
    bench.autopilot.mode = TAKE_OFF
    bench.turn(3.0)
    before = len(bench.autopilot.orders())
    bench.autopilot.mode = FlightMode.OTHER
    assert bench.turn(30.0) is VehicleMode.MANUAL
    assert len(bench.autopilot.orders()) == before


def test_motors_that_stop_again_end_the_take_off(bench: Bench) -> None:
    """It is taken back, as more orders to arm may be on their way."""
    climb(bench)
    bench.autopilot.armed = False
    assert bench.turn(0.1) is VehicleMode.LANDING
    assert disarms(bench) == 1
    assert "it stopped its motors again" in refusal(bench)


def test_an_autopilot_that_starts_anew_ends_the_take_off(bench: Bench) -> None:
    """Told at the next one."""
    bench.vehicle.take_off(3.0)
    bench.turn(0.1)
    bench.autopilot.say(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, mavlink.MAV_STATE_BOOT, 3))
    bench.turn(1.0)
    assert "the autopilot started anew" in refusal(bench)


@pytest.mark.parametrize(("up", "taken"), [(1.6, True), (2.0, False)])
def test_a_hold_well_below_the_height_is_a_pilots(bench: Bench, up: float, *, taken: bool) -> None:
    """PX4 holds by itself at most 1.2 m below it."""
    climb(bench)
    bench.autopilot.mode = TAKE_OFF
    bench.autopilot.landed = mavlink.MAV_LANDED_STATE_IN_AIR
    bench.rise(up)
    bench.turn(3.0)
    bench.autopilot.mode = HOLD
    assert bench.turn(0.5) is (VehicleMode.MANUAL if taken else VehicleMode.TAKING_OFF)


def test_motors_that_turn_are_stopped_again(bench: Bench) -> None:
    """Once the order before was answered; and the waiting of 1.5 s begins anew."""
    climb(bench)
    bench.vehicle.land()
    bench.turn(0.2)
    assert disarms(bench) == 1, "the first is still under way"
    bench.autopilot.result, bench.autopilot.armed = ACCEPTED, False
    answer(bench, ARM)
    assert bench.turn(1.0) is VehicleMode.LANDING
    bench.autopilot.armed = True
    bench.turn(0.1)
    assert disarms(bench) >= 2
    bench.autopilot.armed = False
    assert bench.turn(1.4) is VehicleMode.LANDING
    assert bench.turn(0.5) is VehicleMode.GROUNDED


@pytest.mark.parametrize("result", [DENIED, mavlink.MAV_RESULT_FAILED])
def test_who_refuses_to_stop_its_motors_flies(bench: Bench, result: int) -> None:
    """It is landed."""
    climb(bench)
    bench.vehicle.land()
    answer(bench, ARM, result)
    assert bench.autopilot.modes()[-1] is LAND
    assert disarms(bench) == 1


def test_who_does_not_answer_is_not_thought_to_fly(bench: Bench) -> None:
    """Motors that turn are told to stop again and again; a landing mode would stop none."""
    climb(bench)
    bench.vehicle.land()
    bench.turn(12.0)
    assert disarms(bench) > 6
    assert LAND not in bench.autopilot.modes()


def test_the_rest_of_a_climb_is_not_flown_from_the_ground(bench: Bench) -> None:
    """PX4 shows hold while the order to take off is lost on the way: no setpoint, no offboard."""
    climb(bench)
    assert bench.turn(4.0) is VehicleMode.TAKING_OFF
    assert bench.autopilot.of(SETPOINT) == []
    assert FlightMode.GUIDED not in bench.autopilot.modes()


def test_an_order_on_the_wire(bench: Bench) -> None:
    """To whom, which, and how often it was sent before."""
    bench.vehicle.take_off(3.0)
    bench.turn(2.2)
    sent: list[Any] = bench.autopilot.of("COMMAND_LONG")
    assert [one.confirmation for one in sent if one.command == MODE] == [0, 1, 2]
    assert {(one.target_system, one.target_component) for one in sent} == {(1, 1)}
