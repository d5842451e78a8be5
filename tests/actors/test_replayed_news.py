"""What a mission hears in a replay counts when it did in flight."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from aerodaas.actors.run.replayed import ReplayedArrivals, WatchedPlanner, as_planned
from aerodaas.mission.planner import PlanRequest
from aerodaas.recording.replay.timeline import NEVER, later
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler
from aerodaas.types.data import Header
from aerodaas.types.status import Message, ReceivedMessage

NEWS, ORDERS = "drone/follow", "drone/@commands/ticker"


def message(stream: str, stamp: int) -> Message[Any]:
    """Something made from the camera's picture of this stamp."""
    return Message(stream, 0, stamp, Header(0, stamp, "drone/cam"), 0, (), f"{stream}@{stamp}")


def heard(arrivals: ReplayedArrivals, now: int) -> list[tuple[str, int]]:
    """What counts before `now`, and when."""
    return [(str(one.item), at) for one, at in arrivals.before(now)]


def test_without_a_recording_everything_counts_when_it_comes() -> None:
    """In the order of coming, but not before time has gone on."""
    arrivals = ReplayedArrivals((), (ORDERS,))
    for stamp in (20, 10):
        arrivals.add(message(NEWS, stamp), now=30)
    assert heard(arrivals, 30) == []
    assert heard(arrivals, 31) == [(f"{NEWS}@20", 30), (f"{NEWS}@10", 30)]


def test_recorded_news_count_when_they_did() -> None:
    """Late as in flight, in the order of the flight; what is new counts at once."""
    known = (ReceivedMessage(NEWS, "drone/cam", 20, 50), ReceivedMessage(NEWS, "drone/cam", 10, 70))
    arrivals = ReplayedArrivals(known, (ORDERS,))
    for stamp in (10, 20, 30):
        arrivals.add(message(NEWS, stamp), now=stamp)
    assert heard(arrivals, 50) == [(f"{NEWS}@30", 30)]
    assert heard(arrivals, 100) == [(f"{NEWS}@20", 50), (f"{NEWS}@10", 70)]


def test_a_command_made_from_something_else_takes_the_next_place() -> None:
    """Each recorded place is taken once."""
    known = (
        ReceivedMessage(ORDERS, "drone/cam", 10, 40),
        ReceivedMessage(ORDERS, "drone/cam", 20, 60),
    )
    arrivals = ReplayedArrivals(known, (ORDERS,))
    for stamp in (11, 20, 21):
        arrivals.add(message(ORDERS, stamp), now=25)
    assert heard(arrivals, 100) == [
        (f"{ORDERS}@21", 25),
        (f"{ORDERS}@11", 40),
        (f"{ORDERS}@20", 60),
    ]


@given(st.lists(st.integers(0, 1000), unique=True), st.integers(-1, 1001))
def test_the_next_stamp_is_the_least_one_later(stamps: list[int], after: int) -> None:
    """Or NEVER."""
    expected = min((stamp for stamp in stamps if stamp > after), default=NEVER)
    assert later(tuple(sorted(stamps)), after) == expected


def request() -> PlanRequest:
    """Ask for nothing in particular."""
    return PlanRequest(0, 0, (), None)  # type: ignore[arg-type]


def test_a_plan_comes_at_the_turn_at_which_it_came() -> None:
    """Asked for at 100, it came at 150 in flight; one that never came is there at once."""
    planner = WatchedPlanner(as_planned(OrderedScheduler(), (50, 150)))
    planner.turn(100)
    planner.submit(request())
    assert planner.poll() is None
    assert not planner.answered
    planner.turn(150)
    assert planner.poll() is not None
    assert bool(planner.answered)
    planner.turn(200)
    planner.submit(request())
    assert planner.poll() is not None
    assert planner.poll() is None


def test_of_requests_that_wait_the_newest_is_answered() -> None:
    """Three requests had two answers in flight, and have so again."""
    planner = as_planned(OrderedScheduler(), (150, 300))
    watched = WatchedPlanner(planner)
    watched.turn(100)
    asked = [request() for _ in range(3)]
    for one in asked:
        watched.submit(one)
    answers = {}
    for turn in (100, 150, 200, 300, 350):
        watched.turn(turn)
        plan = watched.poll()
        if plan is not None:
            answers[turn] = plan.request
    assert answers == {150: asked[0], 300: asked[2]}
