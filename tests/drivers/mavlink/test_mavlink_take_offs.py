"""A take-off order by order: what is sent when, what ends it, and what is taken back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.control.departure import Departure
from aerodaas.drivers.mavlink.control.withdrawal import Withdrawal
from aerodaas.drivers.mavlink.microservices.commander import Commander
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink

MODE = mavlink.MAV_CMD_DO_SET_MODE
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
RISE = mavlink.MAV_CMD_NAV_TAKEOFF
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
DENIED = mavlink.MAV_RESULT_DENIED
LATER = mavlink.MAV_RESULT_TEMPORARILY_REJECTED


class TakeOff:
    """One vehicle on the ground in a mode of its pilot's, 4 m up in its own frame (z is -4)."""

    def __init__(self, height: float = 3.0) -> None:
        self.now = 100.0
        self.sent: list[Any] = []
        self.landings = 0
        self.flies = False
        self.commander = Commander(self.sent.append, (1, 1), 245)
        self.telemetry = Telemetry()
        self.telemetry.position = np.array([1.0, 2.0, -4.0])
        self.telemetry.heard_at = self.now
        self.phase = FlightPhase()
        self.phase.observe(FlightMode.OTHER, self.now, armed=False, critical=False)
        self.departure = Departure(
            self.commander,
            self.telemetry,
            self.phase,
            disarm=PX4.disarm(),
            hold=PX4().ask_mode(FlightMode.HOLD),
            flies=lambda: self.flies,
            words=lambda: ["compass: missing", "GPS: no fix"],
            land=self._land,
            short=PX4.stops_short,
        )
        self.departure.begin(PX4().take_off(height, self.telemetry), height, self.now)

    def _land(self) -> None:
        self.landings += 1

    @property
    def orders(self) -> list[int]:
        """Numbers of the orders that were sent."""
        return [one.command for one in self.sent]

    def answer(self, number: int, result: int = ACCEPTED) -> None:
        """Acknowledge."""
        ack = mavlink.MAVLink_command_ack_message(number, result, 0, 0, 245, 191)
        self.commander.take(ack, self.now)

    def beat(self, shown: FlightMode, *, armed: bool) -> None:
        """A HEARTBEAT comes."""
        was_armed = self.phase.armed
        self.telemetry.heard_at = self.now
        climbed = self.departure.climbed
        self.phase.observe(shown, self.now, armed=armed, critical=False, climbed=climbed)
        self.departure.observe(self.now, was_armed=was_armed)

    def turn(self, seconds: float = 0.0, up: float | None = None, rise: float = 0.0) -> None:
        """Time passes; the vehicle is `up` metres above where it was."""
        self.now += seconds
        if up is not None:
            self.telemetry.position = np.array([1.0, 2.0, -4.0 - up])
        self.telemetry.velocity = np.array([0.0, 0.0, -rise])
        self.commander.turn(self.now)
        self.departure.turn(self.now)

    def climb(self) -> None:
        """As far as the climb itself: in hold, armed, and told to rise."""
        self.answer(MODE)
        self.beat(FlightMode.HOLD, armed=False)
        self.answer(ARM)
        self.beat(FlightMode.HOLD, armed=True)


def test_each_order_waits_for_the_one_before() -> None:
    """The mode, the motors, the climb; each mode is expected from its order on."""
    flight = TakeOff()
    assert flight.departure.climbs
    assert flight.orders == [MODE]
    assert (flight.departure.goal, flight.phase.wish) == (None, FlightMode.HOLD)
    flight.answer(MODE)
    assert flight.orders == [MODE, ARM]
    assert (flight.departure.goal, flight.phase.wish) == (None, FlightMode.HOLD)
    flight.answer(ARM)
    assert flight.orders == [MODE, ARM, RISE]
    assert flight.departure.goal == 7.0, "3 m above the 4 m at which it stands"
    assert flight.phase.wish is FlightMode.TAKE_OFF
    assert (flight.departure.refusal, flight.departure.withdrawing) == ("", False)


def test_what_shows_to_be_done_is_done() -> None:
    """The mode by HEARTBEAT, the motors by HEARTBEAT, the climb by having lifted."""
    flight = TakeOff()
    flight.turn(0.1)
    assert flight.orders == [MODE]
    flight.beat(FlightMode.HOLD, armed=False)
    flight.turn(0.1)
    assert flight.orders == [MODE, ARM]
    flight.beat(FlightMode.HOLD, armed=True)
    flight.turn(0.1)
    assert flight.orders == [MODE, ARM, RISE]
    flight.turn(0.1)
    flight.turn(1.0)
    assert flight.orders == [MODE, ARM, RISE, RISE], "it has not lifted"
    flight.flies = True
    flight.turn(0.1)
    assert flight.commander.under_way(RISE) is None
    assert flight.departure.climbs, "it still rises"


@pytest.mark.parametrize(
    ("up", "rise", "done"),
    [
        (2.69, 0.0, False),
        (2.71, 0.0, True),
        (3.5, 0.0, True),
        (2.9, 0.3, False),
        (2.9, -0.31, False),
        (2.9, 0.29, True),
        (2.9, -0.29, True),
        (3.99, 2.0, False),
        (4.01, 2.0, True),
    ],
)
def test_when_a_climb_is_done(up: float, rise: float, *, done: bool) -> None:
    """Within a tenth of 3 m below the height, and no faster than 0.3 m/s up or down.

    A metre above it the climb is ended, however fast it is.
    """
    flight = TakeOff()
    flight.climb()
    flight.turn(3.0, up, rise)
    assert flight.departure.climbs is not done
    assert flight.departure.goal == (None if done else 7.0)


@pytest.mark.parametrize(("up", "done"), [(0.79, False), (0.81, True)])
def test_a_low_climb_is_done_two_decimetres_below(up: float, *, done: bool) -> None:
    """A tenth of a metre would be asked too much."""
    flight = TakeOff(1.0)
    flight.climb()
    flight.turn(3.0, up)
    assert flight.departure.climbs is not done


def test_a_climb_without_a_position_waits() -> None:
    """An estimator that starts anew has none for a moment."""
    flight = TakeOff()
    flight.climb()
    flight.telemetry.position = None
    flight.turn(3.0)
    assert flight.departure.climbs


@pytest.mark.parametrize(("seconds", "failed"), [(20.0, False), (20.1, True)])
def test_motors_that_do_not_start_within_twenty_seconds(seconds: float, *, failed: bool) -> None:
    """Told with the autopilot's own words; no order to start them is left."""
    flight = TakeOff()
    flight.answer(MODE)
    flight.answer(ARM)
    flight.now += seconds
    flight.departure.turn(flight.now)
    words = "it did not start its motors; compass: missing; GPS: no fix"
    assert flight.departure.refusal == (words if failed else "")
    assert flight.departure.climbs is not failed
    assert (flight.commander.under_way(RISE) is None) is failed


def test_a_refused_mode_needs_no_taking_back() -> None:
    """Nothing that starts motors was sent."""
    flight = TakeOff()
    flight.answer(MODE, DENIED)
    assert flight.departure.refusal == "mode hold: denied; compass: missing; GPS: no fix"
    assert not flight.departure.climbs
    assert not flight.departure.withdrawing
    assert flight.orders == [MODE]
    flight.turn(30.0)
    assert flight.orders == [MODE]


def test_a_refused_order_to_arm_is_taken_back() -> None:
    """Hold, in which a late one does no harm, and motors off; then it rests."""
    flight = TakeOff()
    flight.answer(MODE)
    flight.answer(ARM, DENIED)
    assert flight.departure.refusal.startswith("arm: denied; ")
    assert flight.departure.withdrawing
    assert [flight.phase.wish] == [FlightMode.LAND]
    assert flight.orders == [MODE, ARM, MODE, ARM]
    assert flight.sent[-1].param1 == 0.0
    assert (flight.sent[2].param2, flight.sent[2].param3) == (4.0, 3.0)
    flight.answer(ARM)
    for half in range(1, 5):
        flight.turn(0.5)
        flight.beat(FlightMode.HOLD, armed=False)
        assert flight.departure.withdrawing is (half < 4)
    assert flight.phase.wish is None
    assert flight.landings == 0


def test_a_refusal_of_what_was_sent_twice_is_doubted() -> None:
    """The first may have been done, and the refusal mean the second: three seconds to show it."""
    for shows in (True, False):
        flight = TakeOff()
        flight.answer(MODE)
        flight.turn(1.0)
        assert flight.orders == [MODE, ARM, ARM]
        flight.answer(ARM, DENIED)
        assert flight.departure.climbs
        flight.turn(3.0)
        assert flight.departure.climbs
        assert flight.orders == [MODE, ARM, ARM]
        if shows:
            flight.beat(FlightMode.HOLD, armed=True)
        flight.turn(0.1)
        assert flight.departure.climbs is shows
        assert flight.orders[3:] == ([RISE] if shows else [MODE, ARM])
        assert ("arm: denied" in flight.departure.refusal) is not shows


def test_an_order_that_another_one_replaced_has_not_failed() -> None:
    """Whoever asked for another mode knows why; the take-off waits."""
    flight = TakeOff()
    flight.commander.give(PX4().ask_mode(FlightMode.LAND), now=flight.now)
    assert flight.departure.climbs
    assert flight.departure.refusal == ""
    assert flight.orders == [MODE, MODE]


def test_called_off_before_motors_it_is_over_at_once() -> None:
    """And nothing of it is repeated."""
    flight = TakeOff()
    flight.departure.call_off(flight.now)
    assert not flight.departure.climbs
    assert not flight.departure.withdrawing
    flight.answer(MODE)
    flight.turn(5.0)
    assert flight.orders == [MODE]
    flight.departure.call_off(flight.now)
    assert not flight.departure.withdrawing


def test_called_off_in_the_air_it_is_landed() -> None:
    """No motor is stopped, no mode of its own is asked for; again with each HEARTBEAT."""
    flight = TakeOff()
    flight.climb()
    flight.flies = True
    flight.turn(0.5, 1.0)
    before = len(flight.sent)
    flight.departure.call_off(flight.now)
    assert flight.landings == 1
    assert flight.departure.withdrawing
    assert not flight.departure.climbs
    flight.turn(1.0)
    flight.beat(FlightMode.TAKE_OFF, armed=True)
    assert flight.landings == 2
    assert flight.phase.taken is None, "the modes of a take-off may still show"
    assert len(flight.sent) == before
    assert flight.commander.under_way(RISE) is None


@pytest.mark.parametrize("shown", [FlightMode.TAKE_OFF, FlightMode.HOLD, FlightMode.GUIDED])
def test_the_modes_of_a_take_off_are_no_pilots_while_it_is_taken_back(shown: FlightMode) -> None:
    """Any other is."""
    flight = TakeOff()
    flight.climb()
    flight.departure.call_off(flight.now)
    flight.turn(1.0)
    taken = []
    for mode in (shown, FlightMode.RETURN):
        flight.beat(mode, armed=True)
        taken.append(flight.phase.taken is not None)
    assert taken == [False, True]
    assert not flight.departure.withdrawing, "who has taken it over is left alone"
    before = len(flight.sent)
    flight.turn(5.0)
    assert len(flight.sent) == before, "nor are unanswered orders repeated"


def test_whoever_takes_over_is_left_alone() -> None:
    """Neither is the climb ordered further, nor anything taken back."""
    flight = TakeOff()
    flight.climb()
    flight.beat(FlightMode.TAKE_OFF, armed=True)
    flight.turn(3.0)
    before = len(flight.sent)
    flight.beat(FlightMode.OTHER, armed=True)
    assert not flight.departure.climbs
    assert not flight.departure.withdrawing
    flight.turn(30.0)
    assert len(flight.sent) == before
    assert flight.landings == 0
    assert flight.departure.refusal == ""


def test_motors_that_stop_again_end_the_take_off() -> None:
    """It is taken back, as more orders to arm may be on their way."""
    flight = TakeOff()
    flight.climb()
    flight.beat(FlightMode.HOLD, armed=False)
    assert flight.departure.refusal.startswith("it stopped its motors again; ")
    assert flight.departure.withdrawing
    idle = TakeOff()
    idle.beat(FlightMode.OTHER, armed=False)
    assert idle.departure.climbs, "they had not started"


def test_an_autopilot_that_starts_anew_ends_the_take_off() -> None:
    """One that is not taking off has nothing to end."""
    flight = TakeOff()
    flight.departure.restart()
    assert flight.departure.refusal.startswith("the autopilot started anew; ")
    flight.departure.refusal = ""
    flight.departure.restart()
    assert flight.departure.refusal == ""


def test_a_new_take_off_forgets_what_was_asked_before() -> None:
    """The wish of the flight before is none any more."""
    flight = TakeOff()
    flight.phase.ask(FlightMode.LAND, flight.now)
    flight.departure.begin(PX4().take_off(2.0, flight.telemetry), 2.0, flight.now)
    assert flight.phase.wish is FlightMode.HOLD


def test_a_mode_that_somebody_chooses_on_the_ground_ends_the_take_off() -> None:
    """No order follows, and the next take-off is told why."""
    flight = TakeOff()
    flight.answer(MODE)
    flight.beat(FlightMode.HOLD, armed=False)
    flight.turn(3.0)
    before = len(flight.sent)
    flight.beat(FlightMode.OTHER, armed=False)
    assert flight.departure.refusal == "its mode is 'other' now, not by us"
    assert not flight.departure.climbs
    assert not flight.departure.withdrawing
    flight.turn(5.0)
    assert len(flight.sent) == before
    assert flight.phase.taken is None, "who takes off later is not refused for it"


def test_a_hold_well_below_the_height_is_a_pilots() -> None:
    """PX4 holds by itself at most 1.2 m below it."""
    for up, taken in ((1.7, True), (1.9, False)):
        flight = TakeOff()
        flight.climb()
        flight.turn(1.0, 1.0, 1.0)
        flight.beat(FlightMode.TAKE_OFF, armed=True)
        flight.turn(3.0, up)
        flight.beat(FlightMode.HOLD, armed=True)
        assert (flight.phase.taken is not None) is taken
        assert flight.departure.climbs is not taken


class TakenBack:
    """A withdrawal since 100 s, with HEARTBEATs as they come."""

    def __init__(self, *, flies: bool = False) -> None:
        self.sent: list[Any] = []
        self.landings = 0
        self.commander = Commander(self.sent.append, (1, 1), 245)
        self.withdrawal = Withdrawal(self.commander, PX4.disarm(), self._land, 100.0, flies=flies)

    def _land(self) -> None:
        self.landings += 1

    def answer(self, result: int, now: float) -> None:
        """Acknowledge the order to stop."""
        ack = mavlink.MAVLink_command_ack_message(ARM, result, 0, 0, 245, 191)
        self.commander.take(ack, now)

    def beats(self, *heartbeats: float, armed: bool = False) -> list[bool]:
        """Whether it is over after each of these HEARTBEATs."""
        over = []
        for now in heartbeats:
            self.withdrawal.observe(now, armed=armed)
            over.append(self.withdrawal.over)
        return over


def test_a_withdrawal_needs_two_heartbeats_and_a_second_and_a_half() -> None:
    """Both: since the last word, and with standing motors after it was answered."""
    taken = TakenBack()
    assert not taken.withdrawal.over
    assert taken.beats(100.1, 100.2) == [False, False]
    taken.answer(ACCEPTED, 100.3)
    assert taken.beats(101.5, 101.5, 101.51) == [False, False, True]
    taken = TakenBack()
    taken.answer(ACCEPTED, 100.3)
    assert taken.beats(110.0, 110.1) == [False, True]


def test_motors_that_turn_are_stopped_again() -> None:
    """Once the order before was answered; and the waiting begins anew."""
    taken = TakenBack()
    assert len(taken.sent) == 1
    taken.beats(100.2, armed=True)
    assert len(taken.sent) == 1, "the first is still under way"
    taken.answer(ACCEPTED, 100.3)
    assert taken.beats(101.0, 101.9) == [False, True]
    taken.beats(102.0, armed=True)
    assert not taken.withdrawal.over
    assert len(taken.sent) == 2
    taken.answer(ACCEPTED, 102.1)
    assert taken.beats(103.0, 103.5, 103.6) == [False, False, True]
    taken.beats(104.0, armed=True)
    taken.answer(ACCEPTED, 104.1)
    assert taken.beats(110.0, 110.1) == [False, True], "one HEARTBEAT is none"


def test_a_vehicle_that_flies_is_landed_with_each_heartbeat() -> None:
    """And once its motors stand, it is over."""
    taken = TakenBack(flies=True)
    assert taken.landings == 1
    taken.beats(101.0, 102.0, armed=True)
    assert taken.landings == 3
    assert taken.sent == []
    assert taken.beats(103.0, 103.5, 103.6) == [False, False, True]
    assert taken.landings == 3


@pytest.mark.parametrize("result", [DENIED, LATER, mavlink.MAV_RESULT_FAILED])
def test_who_refuses_to_stop_its_motors_flies(result: int) -> None:
    """It is landed at once, and with each HEARTBEAT that shows turning motors."""
    taken = TakenBack()
    taken.answer(result, 100.1)
    assert taken.landings == 1
    taken.beats(101.0, armed=True)
    assert taken.landings == 2
    assert len(taken.sent) == 1


def test_who_does_not_answer_is_not_thought_to_fly() -> None:
    """Nor one whose order was replaced: motors that turn are told to stop again."""
    taken = TakenBack()
    for second in range(101, 110):
        taken.commander.turn(float(second))
    assert len(taken.sent) == 6
    taken.beats(110.0, armed=True)
    assert taken.landings == 0
    assert len(taken.sent) == 7
    taken.commander.give(PX4.disarm(), now=110.5)
    taken.answer(ACCEPTED, 111.0)
    taken.beats(111.5, armed=True)
    assert taken.landings == 0
    assert len(taken.sent) == 9
