"""What becomes of navigation that arrives in flight: taken, refused, in order, and by whom."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from flights import Flight, add, flight, live, navigation, square

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import LimitsConfig
from aerodaas.dataflow.graph import AeroStreamData, Graph
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import VelocitySetpoint
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.mission.commands import (
    AddNavigation,
    Answer,
    CloseStream,
    OpenStream,
    ReturnHome,
    StreamItem,
)
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler

SEEN = Header(7, 3, "drone/camera")


class Backwards(TrajectoryScheduler):
    """Plans the reverse of the order given."""

    isolated = False

    def plan(
        self,
        pending: Sequence[Waypoint],
        situation: PlanningContext,  # noqa: ARG002
    ) -> Sequence[Waypoint]:
        """Turn the order round."""
        return list(reversed(pending))


def item(
    *waypoints: Waypoint, stream: str = "drone/follow", index: int | None = None
) -> StreamItem:
    """Waypoints by stream."""
    return StreamItem(stream, navigation(waypoints), SEEN, index)


def velocity(**axes: Any) -> AeroNavigation:  # noqa: ANN401
    """One velocity command."""
    return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [VelocityCommand(**axes)])


def queued(one: Flight) -> list[str]:
    """Ids in the order in which they will be served."""
    status = one.status
    served = [status.target] if status.target is not None else []
    return [waypoint.id for waypoint in (*served, *status.pending)]


def test_a_closed_stream_feeds_no_more() -> None:
    """Its items are refused, and the drone waits for none; closing it twice does no harm."""
    one = flight(live("a"), live("b"), add(Waypoint("wp", 5, 0, 1.5)))
    one.run_to(S.ENROUTE)
    for name in ("a", "a", "never opened"):
        assert one.tell(CloseStream(name)).accepted
    refused = one.tell(item(Waypoint("late", 1, 1, 1.5), stream="a"))
    assert refused == Answer(accepted=False, text="no stream called 'a' is open")
    one.run(20.0)
    one.expect(S.HOLDING)
    assert one.tell(CloseStream("b")).accepted
    one.turn()
    one.expect(S.RETURNING)
    assert one.status.reason == "all waypoints are visited"


def test_a_clear_by_an_empty_navigation_is_accepted() -> None:
    """To abort and say nothing more is a whole command; without the abort it says nothing."""
    one = flight(live(), add(*square()))
    one.run(10.0)
    empty = AeroNavigation()
    nothing = one.tell(AddNavigation(empty))
    assert nothing.accepted is False
    assert "nothing to fly" in nothing.text
    assert queued(one)
    assert one.tell(AddNavigation(empty, clear_first=True)) == Answer(accepted=True)
    assert not queued(one)


def test_a_stream_is_opened_and_not_added() -> None:
    """With or without an abort before it."""
    one = flight(add(*square()))
    stream = AeroNavigation(data=AeroStreamData[AeroNavigation](Graph(), "later", AeroNavigation))
    for clear_first in (False, True):
        answer = one.tell(AddNavigation(stream, clear_first=clear_first))
        assert answer.accepted is False
        assert "OpenStream" in answer.text


@pytest.mark.parametrize("own", [None, 300.0])
def test_the_deadline_of_a_batch_is_that_of_each_waypoint(own: float | None) -> None:
    """The earlier of both counts; one that is exactly past refuses the waypoint."""
    one = flight(live(), add(*square()))
    one.run(10.0)
    late = AddNavigation(navigation([Waypoint("late", 1, 1, 1.5, deadline=own)]), deadline=10.0)
    answer = one.tell(late)
    assert answer.accepted is False
    assert answer.text == answer.refused["late"]
    assert "past" in answer.text
    one.tell(OpenStream("soon", deadline=10.0))
    assert "past" in one.tell(item(Waypoint("soon", 1, 1, 1.5), stream="soon")).text
    one.tell(AddNavigation(navigation([Waypoint("wp", 1, 1, 1.5, deadline=own)]), deadline=60.0))
    assert {w.deadline for w in one.status.pending if w.id == "wp"} == {60.0}


def test_a_refused_waypoint_leaves_the_good_one_of_its_id_alone() -> None:
    """A duplicate is told of; what is queued or was reached stands in no other list."""
    one = flight(live(), add(Waypoint("wp", 5, 0, 1.5), Waypoint("on", 9, 0, 1.5)))
    one.run_to(S.ENROUTE)
    answer = one.tell(add(Waypoint("wp", 1, 1, 1.5)))
    assert "already queued" in answer.refused["wp"]
    assert not one.status.given_up
    assert [alert.kind for alert in one.mission.alerts] == ["refused"]
    one.run(until=lambda: "wp" in one.status.visited)
    assert one.tell(add(Waypoint("wp", 9e6, 1, 1.5))).refused
    assert not one.status.given_up
    assert one.tell(add(Waypoint("new", 9e6, 1, 1.5))).refused
    assert one.status.given_up == ("new",)
    assert one.tell(add(Waypoint("new", 9, 9, 1.5))).accepted
    assert not one.status.given_up


def test_all_that_is_refused_is_told_with_its_reason_and_time() -> None:
    """In the answer, in the status and as alerts; the good ones of the batch are flown."""
    one = flight(live(), add(*square()))
    one.run(10.0)
    answer = one.tell(
        add(Waypoint("a", 0, 5000, 2), Waypoint("b", 0, 0, 900), Waypoint("c", 3, 3, 2))
    )
    assert answer.accepted is True
    assert answer.text == "; ".join(answer.refused[name] for name in ("a", "b"))
    told = [alert for alert in one.mission.alerts if alert.kind == "given_up"]
    assert [alert.text for alert in told] == list(answer.refused.values())
    assert {alert.header.stamp for alert in told} == {one.now}
    assert set(one.status.given_up) == {"a", "b"}


def test_where_an_item_of_a_stream_is_queued() -> None:
    """At its own index, else at its stream's, else behind."""
    one = flight(live("end"), OpenStream("front", index=0), add(*square()))
    one.tell(item(Waypoint("x", 1, 1, 1.5), stream="end"))
    one.tell(item(Waypoint("y", 1, 1, 1.5), stream="front"))
    one.tell(item(Waypoint("z", 1, 1, 1.5), stream="front", index=2))
    one.tell(item(Waypoint("u", 1, 1, 1.5), stream="end", index=1))
    assert queued(one) == ["y", "u", "wp1", "z", "wp2", "wp3", "wp4", "x"]


def test_a_stream_keeps_its_order_of_arrival_and_binds_no_other() -> None:
    """However the scheduler plans; what may be reordered is, around it."""
    one = flight(
        live("a"),
        live("b"),
        OpenStream("loose", ordered=False),
        scheduler=Backwards(),
        start=True,
    )
    one.run_to(S.HOLDING)
    for stream in ("loose", "a", "b"):
        one.tell(item(Waypoint(f"{stream}1", 5, 5, 1.5), stream=stream))
        one.tell(item(Waypoint(f"{stream}2", 5, 5, 1.5), stream=stream))
    one.turn()
    assert queued(one) == ["b1", "b2", "a1", "a2", "loose2", "loose1"]


def test_batches_added_by_hand_keep_their_own_order_each() -> None:
    """Two ordered ones are two groups; an unordered one is none."""
    one = flight(live(), scheduler=Backwards())
    one.run_to(S.HOLDING)
    for name in ("a", "b"):
        one.tell(add(Waypoint(f"{name}1", 5, 5, 1.5), Waypoint(f"{name}2", 5, 5, 1.5)))
    one.tell(add(Waypoint("c1", 5, 5, 1.5), Waypoint("c2", 5, 5, 1.5), ordered=False))
    one.turn()
    assert queued(one) == ["c2", "c1", "b1", "b2", "a1", "a2"]


def test_a_stream_moves_its_own_waypoints_only() -> None:
    """The same id again is a target that moved; of another stream or by hand it is refused."""
    one = flight(live("a"), live("b"), add(Waypoint("mine", 9, 9, 1.5)))
    one.tell(item(Waypoint("person", 1, 1, 1.5), stream="a"))
    assert one.tell(item(Waypoint("person", 2, 2, 1.5), stream="a")).accepted
    for refused in (
        one.tell(item(Waypoint("person", 3, 3, 1.5), stream="b")),
        one.tell(add(Waypoint("person", 3, 3, 1.5))),
        one.tell(item(Waypoint("mine", 3, 3, 1.5), stream="a")),
        one.tell(
            StreamItem("a", navigation([Waypoint("person", 3, 3, 1.5)]), SEEN, replaces=False)
        ),
    ):
        assert refused.accepted is False
        assert "already queued" in refused.text
    assert [(w.id, w.x) for w in one.status.pending] == [("mine", 9.0), ("person", 2.0)]


def test_a_setpoint_names_the_measurement_that_it_was_made_from() -> None:
    """Of a waypoint and of a velocity command, by stream and by hand."""
    one = flight(live())
    one.run_to(S.HOLDING)
    one.tell(item(Waypoint("person", 9, 0, 1.5)))
    assert one.turn().cause == SEEN
    one.tell(StreamItem("drone/follow", velocity(forward=1.0, priority=0), SEEN))
    assert one.turn().cause == SEEN
    other = Header(8, 4, "operator")
    one.tell(AddNavigation(navigation([Waypoint("now", 0, 5, 1.5, priority=-1)]), cause=other))
    assert one.turn().cause == other


def test_silence_is_counted_from_the_last_navigation_that_was_taken() -> None:
    """From the stream's opening, a command or a clear; not from what is refused."""
    limits = LimitsConfig(command_timeout=1.0, silence_return=4.0)

    def after(command: object) -> float:
        one = flight(live(), limits=limits)
        one.run_to(S.HOLDING)
        one.run(3.0)
        said = one.seconds
        if command is not None:
            one.tell(command)  # type: ignore[arg-type]
        one.run(until=lambda: one.mission.state in {S.RETURNING, S.LANDING})
        assert "silent" in one.status.reason
        return one.seconds - said

    assert after(None) == pytest.approx(2.0, abs=0.2)
    assert after(item(Waypoint("far", 0, 5000, 2))) == pytest.approx(2.0, abs=0.2)
    assert after(StreamItem("drone/follow", ())) == pytest.approx(2.0, abs=0.2)
    for heard in (
        StreamItem("drone/follow", velocity(yaw_rate=0.1)),
        AddNavigation(AeroNavigation(), clear_first=True),
        AddNavigation(velocity(yaw_rate=0.1)),
        live("another"),
    ):
        assert after(heard) == pytest.approx(5.0, abs=0.2), heard


def test_a_batch_that_is_refused_moves_nothing() -> None:
    """An answer that says no is the truth about all of the batch, its velocity commands too."""
    one = flight(live())
    one.run_to(S.HOLDING)
    both = AeroNavigation(
        NavigationType.ANALYTICS_DRIVEN, [VelocityCommand(2.0), Waypoint("wp", 5, 5, 1.5)]
    )
    answer = one.tell(AddNavigation(both, index=-1))
    assert answer.accepted is False
    assert "negative" in answer.text
    asked = one.turn().asked
    assert not isinstance(asked, VelocitySetpoint) or not asked.velocity.any()
    one.expect(S.HOLDING)


def test_a_stream_that_clears_once_does_so_for_any_item() -> None:
    """One of detections says nothing to fly, and is done with that; it clears only once."""
    one = flight(OpenStream("seen", feeds=False, clear_first=True), add(*square()))
    one.run_to(S.ENROUTE)
    for nothing in (None, ()):
        assert one.tell(StreamItem("seen", nothing)) == Answer(accepted=True)
        assert queued(one)
    assert one.tell(StreamItem("seen", "person")) == Answer(accepted=True)
    assert not queued(one)
    one.tell(add(Waypoint("after", 4, 4, 1.5)))
    assert one.tell(StreamItem("seen", "person")) == Answer(accepted=True)
    assert queued(one) == ["after"]
    one.run()
    one.expect(S.LANDED)
    assert one.now > NANOSECONDS


def test_navigation_is_refused_while_the_drone_leaves() -> None:
    """By hand and by stream, and the answer says what it does instead."""
    one = flight(live(), add(Waypoint("far", 20, 0, 1.5)))
    one.run(10.0)
    one.tell(ReturnHome())
    refusal = Answer(accepted=False, text="the drone is returning by now")
    assert one.tell(add(Waypoint("late", 1, 1, 1.5))) == refusal
    assert one.tell(item(Waypoint("late", 1, 1, 1.5))) == refusal
    assert one.tell(StreamItem("drone/follow", velocity(forward=1.0))) == refusal


def test_a_stream_with_a_priority_leaves_the_order_as_it_came() -> None:
    """Each item says whether it may be reordered; the priority alone is the stream's."""
    one = flight(OpenStream("urgent", priority=0), scheduler=Backwards())
    one.run_to(S.HOLDING)
    for name, ordered in (("a", True), ("b", False)):
        batch = [Waypoint(f"{name}{number}", 5, 5, 1.5, priority=9) for number in (1, 2)]
        one.tell(StreamItem("urgent", navigation(batch, ordered=ordered)))
    one.turn()
    assert queued(one) == ["b2", "b1", "a1", "a2"]
    assert {waypoint.priority for waypoint in one.status.pending} == {0}
