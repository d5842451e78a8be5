"""Orders and modes at their edges: when they are repeated, who has answered, and who flies."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from autopilot import COMMANDS, ScriptedAutopilot, acknowledgement
from hypothesis import given
from hypothesis import strategies as st

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
from aerodaas.messages.vehicle import VehicleMode

OURS = 245
LATER = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
ARM = PendingCommand(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0, 0, 0, 0, 0, 0, 0), "arm")
CLIMB = PendingCommand(mavlink.MAV_CMD_NAV_TAKEOFF, (1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5), "take off")


class Orders:
    """What a commander gives to a scripted autopilot that answers nothing by itself."""

    def __init__(self, in_touch: Callable[[float], bool] = lambda _: True) -> None:
        self.autopilot = ScriptedAutopilot(result=None)
        self.told: list[CommandResult] = []
        self.commander = Commander(self.autopilot.send, (1, 1), OURS, in_touch)

    @property
    def sent(self) -> list[Any]:
        """Commands that it received."""
        return self.autopilot.of(*COMMANDS)

    def give(self, order: PendingCommand, now: float = 0.0) -> None:
        """Give an order."""
        self.commander.give(order, self.told.append, now=now)

    def answer(self, order: PendingCommand, result: int, now: float, system: int = OURS) -> None:
        """Acknowledge it, to `system`."""
        self.commander.on_ack(acknowledgement(order.number, result, system), now)


def test_a_command_with_a_frame_carries_whole_degrees_times_ten_million() -> None:
    """As COMMAND_INT, whose fifth and sixth parameters are integers."""
    orders = Orders()
    values = (1.5, 2.5, 3.5, 4.5, 473977420.0, -85455940.0, 500.5)
    orders.give(PendingCommand(CLIMB.number, values, "take off", mavlink.MAV_FRAME_GLOBAL))
    (sent,) = orders.sent
    assert sent.get_type() == "COMMAND_INT"
    assert (sent.target_system, sent.target_component) == (1, 1)
    assert (sent.frame, sent.command) == (mavlink.MAV_FRAME_GLOBAL, CLIMB.number)
    assert (sent.current, sent.autocontinue) == (0, 0)
    assert (sent.param1, sent.param2, sent.param3, sent.param4) == values[:4]
    assert (sent.x, sent.y, sent.z) == (473977420, -85455940, 500.5)
    assert isinstance(sent.x, int)
    assert isinstance(sent.y, int)


def test_an_order_is_repeated_after_a_second() -> None:
    """Not before; each repetition waits a second of its own."""
    orders = Orders()
    orders.give(ARM, 10.0)
    for now, sent in ((10.99, 1), (11.0, 2), (11.99, 2), (12.5, 3), (13.4, 3), (13.5, 4)):
        orders.commander.step(now)
        assert len(orders.sent) == sent


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
    orders = Orders()
    orders.give(ARM, 0.0)
    orders.commander.step(1.0)
    orders.answer(ARM, result, 1.1)
    assert orders.told == [CommandResult(accepted=accepted, text=text, tries=2)]
    assert orders.commander.under_way(ARM.number) is None


def test_an_order_that_does_not_insist_is_rejected_at_once() -> None:
    """Whatever else its rejection for now would mean."""
    orders = Orders()
    once = PendingCommand(ARM.number, ARM.values, "disarm", insists=False)
    orders.give(once, 0.0)
    orders.answer(once, LATER, 0.1)
    assert orders.told == [CommandResult(accepted=False, text="rejected for now", tries=1)]


def test_whose_answer_it_is() -> None:
    """Ours, or everybody's (0); another's is not even stray, and one to nothing is counted."""
    orders = Orders()
    orders.give(ARM, 0.0)
    orders.answer(ARM, mavlink.MAV_RESULT_ACCEPTED, 0.1, system=7)
    assert (orders.told, orders.commander.stray) == ([], 0)
    orders.answer(ARM, mavlink.MAV_RESULT_ACCEPTED, 0.1, system=0)
    assert orders.told == [CommandResult(accepted=True)]
    for times in (1, 2):
        orders.answer(CLIMB, mavlink.MAV_RESULT_ACCEPTED, 0.2)
        assert orders.commander.stray == times
    orders.give(ARM, 0.3)
    orders.answer(ARM, mavlink.MAV_RESULT_ACCEPTED, 0.4)
    assert orders.told[1:] == [CommandResult(accepted=True)]


def test_orders_of_different_numbers_go_side_by_side() -> None:
    """One that waits holds up none behind it; each ends by itself."""
    orders, done = Orders(), [False]
    told: list[CommandResult] = []
    orders.commander.give(ARM, orders.told.append, still=lambda: not done[0], now=0.5)
    orders.commander.give(CLIMB, told.append, now=0.0)
    assert orders.commander.under_way(ARM.number) is ARM
    assert orders.commander.under_way(CLIMB.number) is CLIMB
    orders.commander.step(1.0)
    assert [one.command for one in orders.sent] == [ARM.number, CLIMB.number, CLIMB.number]
    done[0] = True
    orders.commander.step(1.2)
    assert orders.told == [CommandResult(accepted=True, tries=1)]
    assert told == []
    assert orders.commander.under_way(ARM.number) is None
    assert orders.commander.under_way(CLIMB.number) is CLIMB
    orders.commander.step(2.0)
    assert len(orders.sent) == 4
    assert orders.sent[3].command == CLIMB.number


def test_a_replaced_order_is_told_so_and_only_of_its_own_number() -> None:
    """Neither done nor refused, in a few words; only what steers is withdrawn."""
    orders, check = Orders(), ArduPilot.check()
    orders.give(check, 0.0)
    orders.commander.withdraw_steering()
    orders.give(CLIMB, 0.1)
    assert orders.told == []
    orders.commander.give(CLIMB, now=0.2)
    replaced = CommandResult(accepted=False, text="replaced by a newer order", replaced=True)
    assert orders.told == [replaced]
    orders.commander.withdraw_steering()
    assert orders.commander.under_way(CLIMB.number) is None
    assert orders.commander.under_way(check.number) is check


def test_what_steers_waits_until_the_vehicle_is_heard() -> None:
    """Nothing is given up meanwhile; other orders do not wait."""
    heard = [False]
    orders = Orders(lambda _: heard[0])
    for order in (ARM, CLIMB, ArduPilot.check()):
        orders.give(order)
    for second in range(1, 20):
        orders.commander.step(float(second))
    assert {one.command for one in orders.sent} == {mavlink.MAV_CMD_RUN_PREARM_CHECKS}
    assert len(orders.told) == 1, "of the check, which is given up"
    heard[0] = True
    orders.commander.step(20.0)
    assert [one.command for one in orders.sent[-2:]] == [ARM.number, CLIMB.number]
    assert len(orders.told) == 1


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


MODES = list(FlightMode)


@given(
    st.lists(
        st.tuples(
            st.sampled_from([None, *[one for one in MODES if one is not FlightMode.OTHER]]),
            st.sampled_from(MODES),
            st.booleans(),
            st.floats(0.0, 5.0),
        ),
        max_size=40,
    )
)
def test_who_has_taken_over_keeps_it(steps: list[tuple[Any, Any, bool, float]]) -> None:
    """Once taken, a vehicle is ours again only after it has been disarmed, or let rest there."""
    phase, now, taken = FlightPhase(), 0.0, False
    for wish, shown, armed, wait in steps:
        now += wait
        if wish is not None and not taken:
            phase.ask(wish, now)
        phase.observe(shown, now, armed=armed, critical=False)
        if phase.taken is not None and not armed:
            phase.rest()
        taken = armed and (taken or phase.taken is not None)
        assert (phase.taken is not None) == taken
        if taken:
            assert phase.mode is VehicleMode.MANUAL
        if not armed:
            assert phase.mode is VehicleMode.GROUNDED


def test_a_withdrawn_order_is_not_repeated() -> None:
    """Nor is anything told of it; one that nobody answers is given up after six tries."""
    orders = Orders()
    orders.give(CLIMB)
    orders.commander.withdraw(CLIMB.number)
    orders.commander.step(5.0)
    orders.answer(CLIMB, mavlink.MAV_RESULT_ACCEPTED, 5.0)
    assert (len(orders.sent), orders.told) == (1, [])
    orders.give(ARM, 6.0)
    for second in range(7, 20):
        orders.commander.step(second * 1.01)
    assert orders.told == [CommandResult(accepted=False, text="no answer", tries=6)]
