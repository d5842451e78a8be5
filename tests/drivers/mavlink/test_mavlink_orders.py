"""Orders and modes at their edges: when they are repeated, who has answered, and who flies."""

from __future__ import annotations

import math
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.control import watchdog
from aerodaas.drivers.mavlink.control.watchdog import Watchdog
from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.vehicle import VehicleMode

OURS = 245
LATER = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
ARM = PendingCommand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0, 0, 0, 0, 0, 0, 0), "arm")
CLIMB = PendingCommand(mavlink.MAV_CMD_NAV_TAKEOFF, (1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5), "take off")


class Ear:
    """What a commander says to system 7, component 1, and what became of its orders."""

    def __init__(self) -> None:
        self.sent: list[Any] = []
        self.told: list[CommandResult] = []
        self.commander = Commander(self.sent.append, (7, 1), OURS)

    def give(self, order: PendingCommand, now: float = 0.0) -> None:
        """Give an order."""
        self.commander.give(order, self.told.append, now=now)

    def answer(self, order: PendingCommand, result: int, now: float, system: int = OURS) -> None:
        """Acknowledge it, to `system`."""
        ack = mavlink.MAVLink_command_ack_message(order.number, result, 0, 0, system, 191)
        self.commander.take(ack, now)


def test_a_command_on_the_wire() -> None:
    """To whom, which, how often before, and its seven parameters in order."""
    ear = Ear()
    ear.give(CLIMB)
    ear.commander.turn(1.0)
    for confirmation, sent in enumerate(ear.sent):
        assert sent.get_type() == "COMMAND_LONG"
        assert (sent.target_system, sent.target_component) == (7, 1)
        assert (sent.command, sent.confirmation) == (CLIMB.number, confirmation)
        assert [getattr(sent, f"param{index}") for index in range(1, 8)] == list(CLIMB.values)
    assert len(ear.sent) == 2


def test_a_command_with_a_frame_carries_whole_degrees_times_ten_million() -> None:
    """As COMMAND_INT, whose fifth and sixth parameters are integers."""
    ear = Ear()
    values = (1.5, 2.5, 3.5, 4.5, 473977420.0, -85455940.0, 500.5)
    ear.give(PendingCommand(CLIMB.number, values, "take off", mavlink.MAV_FRAME_GLOBAL))
    (sent,) = ear.sent
    assert sent.get_type() == "COMMAND_INT"
    assert (sent.target_system, sent.target_component) == (7, 1)
    assert (sent.frame, sent.command) == (mavlink.MAV_FRAME_GLOBAL, CLIMB.number)
    assert (sent.current, sent.autocontinue) == (0, 0)
    assert (sent.param1, sent.param2, sent.param3, sent.param4) == values[:4]
    assert (sent.x, sent.y, sent.z) == (473977420, -85455940, 500.5)
    assert isinstance(sent.x, int)
    assert isinstance(sent.y, int)


def test_an_order_is_repeated_after_a_second() -> None:
    """Not before; each repetition waits a second of its own."""
    ear = Ear()
    ear.give(ARM, 10.0)
    for now, sent in ((10.99, 1), (11.0, 2), (11.99, 2), (12.5, 3), (13.4, 3), (13.5, 4)):
        ear.commander.turn(now)
        assert len(ear.sent) == sent


def test_the_word_that_it_is_worked_on_buys_five_seconds() -> None:
    """From that word on; the order is sent again only after them."""
    ear = Ear()
    ear.give(ARM, 0.0)
    ear.answer(ARM, mavlink.MAV_RESULT_IN_PROGRESS, 0.5)
    ear.commander.turn(5.49)
    assert len(ear.sent) == 1
    ear.commander.turn(5.5)
    assert len(ear.sent) == 2
    assert ear.told == []


def test_of_two_rejections_for_now_the_first_counts() -> None:
    """It is sent again a second after the first; a rejection of that begins another second."""
    ear = Ear()
    ear.give(ARM, 0.0)
    ear.answer(ARM, LATER, 0.2)
    ear.answer(ARM, LATER, 0.9)
    ear.commander.turn(1.19)
    assert len(ear.sent) == 1
    ear.commander.turn(1.2)
    assert len(ear.sent) == 2
    ear.answer(ARM, LATER, 1.5)
    ear.commander.turn(2.49)
    assert len(ear.sent) == 2
    ear.commander.turn(2.5)
    assert len(ear.sent) == 3


def test_what_is_said_of_an_order_that_is_given_up_is_the_latest() -> None:
    """Rejected once and never answered again, it has no answer; rejected last, it is rejected."""
    for last, text in ((1.1, "no answer"), (9.0, "rejected for now")):
        ear = Ear()
        ear.give(ARM, 0.0)
        for tenth in range(1, 100):
            now = tenth / 10
            if now < last and len(ear.sent) > 0:
                ear.answer(ARM, LATER, now)
            ear.commander.turn(now)
        assert [outcome.text for outcome in ear.told] == [text]
        assert ear.told[0].tries == len(ear.sent) == 6


@pytest.mark.parametrize(
    ("result", "accepted", "text"),
    [
        (mavlink.MAV_RESULT_ACCEPTED, True, ""),
        (mavlink.MAV_RESULT_DENIED, False, "denied"),
        (mavlink.MAV_RESULT_UNSUPPORTED, False, "not supported"),
        (mavlink.MAV_RESULT_FAILED, False, "failed"),
        (6, False, "result 6"),
    ],
)
def test_what_an_answer_means(result: int, *, accepted: bool, text: str) -> None:
    """In words where there are any, told with how often the order was sent."""
    ear = Ear()
    ear.give(ARM, 0.0)
    ear.commander.turn(1.0)
    ear.answer(ARM, result, 1.1)
    assert ear.told == [CommandResult(accepted=accepted, text=text, tries=2)]
    assert ear.commander.under_way(ARM.number) is None


def test_an_order_that_does_not_insist_is_rejected_at_once() -> None:
    """Whatever else its rejection for now would mean."""
    ear = Ear()
    once = PendingCommand(ARM.number, ARM.values, "disarm", insists=False)
    ear.give(once, 0.0)
    ear.answer(once, LATER, 0.1)
    assert ear.told == [CommandResult(accepted=False, text="rejected for now", tries=1)]


def test_whose_answer_it_is() -> None:
    """Ours, or everybody's (0); another's is not even stray, and one to nothing is counted."""
    ear = Ear()
    ear.give(ARM, 0.0)
    ear.answer(ARM, mavlink.MAV_RESULT_ACCEPTED, 0.1, system=7)
    assert (ear.told, ear.commander.stray) == ([], 0)
    ear.answer(ARM, mavlink.MAV_RESULT_ACCEPTED, 0.1, system=0)
    assert ear.told == [CommandResult(accepted=True)]
    for times in (1, 2):
        ear.answer(CLIMB, mavlink.MAV_RESULT_ACCEPTED, 0.2)
        assert ear.commander.stray == times
    ear.give(ARM, 0.3)
    ear.answer(ARM, mavlink.MAV_RESULT_ACCEPTED, 0.4)
    assert ear.told[1:] == [CommandResult(accepted=True)]


def test_orders_of_different_numbers_go_side_by_side() -> None:
    """One that waits holds up none behind it; each ends by itself."""
    ear, done = Ear(), [False]
    told: list[CommandResult] = []
    ear.commander.give(ARM, ear.told.append, still=lambda: not done[0], now=0.5)
    ear.commander.give(CLIMB, told.append, now=0.0)
    assert ear.commander.under_way(ARM.number) is ARM
    assert ear.commander.under_way(CLIMB.number) is CLIMB
    ear.commander.turn(1.0)
    assert [one.command for one in ear.sent] == [ARM.number, CLIMB.number, CLIMB.number]
    done[0] = True
    ear.commander.turn(1.2)
    assert ear.told == [CommandResult(accepted=True, tries=1)]
    assert told == []
    assert ear.commander.under_way(ARM.number) is None
    assert ear.commander.under_way(CLIMB.number) is CLIMB
    ear.commander.turn(2.0)
    assert len(ear.sent) == 4
    assert ear.sent[3].command == CLIMB.number


def test_a_replaced_order_is_told_so_and_only_of_its_own_number() -> None:
    """Neither done nor refused, in a few words; only what steers is withdrawn."""
    ear, check = Ear(), ArduPilot.check()
    ear.give(check, 0.0)
    ear.commander.withdraw_steering()
    ear.give(CLIMB, 0.1)
    assert ear.told == []
    ear.commander.give(CLIMB, now=0.2)
    replaced = CommandResult(accepted=False, text="replaced by a newer order", replaced=True)
    assert ear.told == [replaced]
    ear.commander.withdraw_steering()
    assert ear.commander.under_way(CLIMB.number) is None
    assert ear.commander.under_way(check.number) is check


def test_what_steers_waits_until_the_vehicle_is_heard() -> None:
    """Nothing is given up meanwhile; other orders do not wait."""
    heard = [False]
    sent: list[Any] = []
    commander = Commander(sent.append, (7, 1), OURS, lambda _: heard[0])
    outcomes: list[CommandResult] = []
    for order in (ARM, CLIMB, ArduPilot.check()):
        commander.give(order, outcomes.append, now=0.0)
    for second in range(1, 20):
        commander.turn(float(second))
    assert {one.command for one in sent} == {mavlink.MAV_CMD_RUN_PREARM_CHECKS}
    assert len(outcomes) == 1, "of the check, which is given up"
    heard[0] = True
    commander.turn(20.0)
    assert [one.command for one in sent[-2:]] == [ARM.number, CLIMB.number]
    assert len(outcomes) == 1


SHOWN = [
    (FlightMode.GUIDED, VehicleMode.GUIDED),
    (FlightMode.TAKE_OFF, VehicleMode.TAKING_OFF),
    (FlightMode.HOLD, VehicleMode.HOLDING),
    (FlightMode.RETURN, VehicleMode.RETURNING),
    (FlightMode.LAND, VehicleMode.LANDING),
    (FlightMode.OTHER, VehicleMode.MANUAL),
]


def seen_in(
    wish: FlightMode | None, *shown: FlightMode, critical: bool = False, armed: bool = True
) -> FlightPhase:
    """A vehicle that was asked for `wish` at 10 s and has shown modes since, each after 5 s."""
    phase = FlightPhase()
    phase.observe(shown[0], 9.0, armed=armed, critical=critical)
    if wish is not None:
        phase.ask(wish, 10.0)
    for index, mode in enumerate(shown[1:], 1):
        phase.observe(mode, 10.0 + 5 * index, armed=armed, critical=critical)
    return phase


@pytest.mark.parametrize(("shown", "mode"), SHOWN)
def test_without_a_wish_the_vehicle_is_believed(shown: FlightMode, mode: VehicleMode) -> None:
    """Found flying in any mode it is nobody's fault; disarmed it is on the ground."""
    assert seen_in(None, shown).mode is mode
    assert seen_in(None, shown, armed=False).mode is VehicleMode.GROUNDED
    assert FlightPhase().mode is VehicleMode.GROUNDED
    assert FlightPhase().shown is FlightMode.OTHER


@pytest.mark.parametrize(
    ("wish", "follows"),
    [
        (FlightMode.GUIDED, {FlightMode.GUIDED}),
        (FlightMode.TAKE_OFF, {FlightMode.TAKE_OFF, FlightMode.GUIDED}),
        (FlightMode.HOLD, {FlightMode.HOLD}),
        (FlightMode.RETURN, {FlightMode.RETURN}),
        (FlightMode.LAND, {FlightMode.LAND}),
    ],
)
def test_what_belongs_to_a_wish(wish: FlightMode, follows: set[FlightMode]) -> None:
    """ArduPilot takes off in guided mode; all else that was seen is another's."""
    for shown in FlightMode:
        phase = seen_in(wish, FlightMode.OTHER, wish, shown)
        assert (phase.taken is None) is (shown in follows), shown
        assert phase.wish is wish
        assert phase.armed


def test_a_critical_vehicle_protects_itself_another_has_a_pilot() -> None:
    """And who has taken it keeps it, whatever is shown or becomes critical later."""
    for critical, taken in ((True, VehicleMode.FAILSAFE), (False, VehicleMode.MANUAL)):
        phase = seen_in(FlightMode.GUIDED, FlightMode.GUIDED, critical=critical)
        phase.observe(FlightMode.GUIDED, 11.0, armed=True, critical=critical)
        phase.observe(FlightMode.LAND, 20.0, armed=True, critical=critical)
        assert (phase.taken, phase.mode) == (taken, taken)
        phase.observe(FlightMode.GUIDED, 21.0, armed=True, critical=not critical)
        assert (phase.taken, phase.mode) == (taken, taken)


@pytest.mark.parametrize(("now", "taken"), [(12.5, None), (12.51, VehicleMode.MANUAL)])
def test_a_mode_of_before_may_show_for_two_and_a_half_seconds(
    now: float, taken: VehicleMode | None
) -> None:
    """After it was seen in the new one: HEARTBEATs overtake each other."""
    phase = FlightPhase()
    phase.observe(FlightMode.HOLD, 9.0, armed=True, critical=False)
    phase.ask(FlightMode.GUIDED, 10.0)
    phase.observe(FlightMode.GUIDED, 11.0, armed=True, critical=False)
    phase.observe(FlightMode.HOLD, now, armed=True, critical=False)
    assert phase.taken is taken


def test_asking_again_for_the_same_buys_time_and_forgets_nothing() -> None:
    """It was seen there, the mode of before is still the one of before, and 2.5 s begin anew."""
    phase = seen_in(FlightMode.GUIDED, FlightMode.HOLD, FlightMode.GUIDED)
    phase.ask(FlightMode.GUIDED, 20.0)
    assert phase.seen is True
    phase.observe(FlightMode.HOLD, 22.5, armed=True, critical=False)
    assert phase.taken is None
    phase.observe(FlightMode.HOLD, 22.6, armed=True, critical=False)
    assert phase.taken is VehicleMode.MANUAL


def test_a_wish_is_not_seen_before_it_shows() -> None:
    """However long the mode before goes on to show, it is no pilot's."""
    phase = FlightPhase()
    assert phase.seen is False
    phase = seen_in(FlightMode.GUIDED, FlightMode.HOLD, FlightMode.GUIDED)
    phase.ask(FlightMode.RETURN, 20.0)
    seen = [phase.seen]
    for now, shown in ((40.0, FlightMode.GUIDED), (41.0, FlightMode.RETURN)):
        phase.observe(shown, now, armed=True, critical=False)
        seen.append(phase.seen)
    assert seen == [False, False, True]
    assert phase.taken is None


def test_all_that_belongs_to_the_wish_before_may_show_for_a_moment() -> None:
    """The mode of before, and what is said beforehand."""
    for shown in (FlightMode.RETURN, FlightMode.TAKE_OFF):
        phase = seen_in(FlightMode.RETURN, FlightMode.GUIDED, FlightMode.RETURN)
        phase.ask(FlightMode.HOLD, 20.0, meanwhile=frozenset({FlightMode.TAKE_OFF}))
        phase.observe(shown, 21.0, armed=True, critical=False)
        assert phase.taken is None
    phase = seen_in(FlightMode.RETURN, FlightMode.GUIDED, FlightMode.RETURN)
    phase.ask(FlightMode.HOLD, 20.0)
    phase.observe(FlightMode.TAKE_OFF, 21.0, armed=True, critical=False)
    assert phase.taken is VehicleMode.MANUAL


def test_nothing_is_asked_of_a_vehicle_that_stands() -> None:
    """Neither after it was disarmed nor after it was let rest; the mode that it shows goes on."""
    phase = seen_in(FlightMode.LAND, FlightMode.LAND, FlightMode.LAND)
    assert phase.seen
    phase.rest()
    assert (phase.wish, phase.seen) == (None, False)
    phase.observe(FlightMode.OTHER, 30.0, armed=True, critical=False)
    assert phase.taken is None
    phase = seen_in(FlightMode.LAND, FlightMode.LAND, FlightMode.LAND, FlightMode.OTHER)
    phase.observe(FlightMode.HOLD, 30.0, armed=False, critical=False)
    assert (phase.wish, phase.taken, phase.seen) == (None, None, False)
    assert (phase.armed, phase.shown) == (False, FlightMode.HOLD)
    phase.ask(FlightMode.TAKE_OFF, 31.0)
    phase.observe(FlightMode.HOLD, 32.0, armed=False, critical=False)
    assert phase.wish is FlightMode.TAKE_OFF, "it has not started its motors yet"


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The watchdog's clock, to be set."""
    at = SimpleNamespace(now=100.0)
    monkeypatch.setattr(watchdog, "time", SimpleNamespace(monotonic=lambda: at.now))
    return at


def test_a_loop_is_alive_for_a_second_and_gone_after_twenty(clock: SimpleNamespace) -> None:
    """Before its first turn it is neither alive nor expected."""
    dog = Watchdog()
    assert not dog.healthy(100.0)
    assert dog.gone(100.0)
    dog.feed()
    for now, healthy, gone in (
        (100.0, True, False),
        (100.99, True, False),
        (101.0, False, False),
        (120.0, False, False),
        (120.01, False, True),
    ):
        assert (dog.healthy(now), dog.gone(now)) == (healthy, gone)
    clock.now = 130.0
    dog.feed()
    assert dog.healthy(130.5)
    assert not dog.gone(150.0)


def test_once_it_belongs_to_a_thread_only_that_one_feeds_it(clock: SimpleNamespace) -> None:
    """Belonging is a turn by itself; before that anybody's turn counts."""
    dog = Watchdog()

    def feed_elsewhere() -> None:
        feeder = threading.Thread(target=dog.feed)
        feeder.start()
        feeder.join()

    feed_elsewhere()
    assert dog.healthy(100.0)
    clock.now = 110.0
    dog.belong()
    assert dog.healthy(110.0)
    clock.now = 115.0
    feed_elsewhere()
    assert not dog.healthy(115.0)
    dog.feed()
    assert dog.healthy(115.0)
    assert not dog.healthy(math.inf)
