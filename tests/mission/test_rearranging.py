"""Coming waypoints change places and are removed as a whole; what was reached is left alone."""

from __future__ import annotations

import pytest
from flights import Flight, add, flight
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import RearrangeNavigation, ReturnHome
from aerodaas.mission.navigation.queue import WaypointQueue
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler


def row(*names: str, hover: float = 0.0, priority: int = 5) -> list[Waypoint]:
    """Waypoints 5 m apart to the east."""
    return [
        Waypoint(name, 5.0 * n, 0, 1.5, hover, priority=priority) for n, name in enumerate(names, 1)
    ]


def enroute(*waypoints: Waypoint, ordered: bool = True) -> Flight:
    """A flight on its way to the first of these."""
    found = flight(add(*waypoints, ordered=ordered), scheduler=NearestNeighborScheduler())
    found.run_to(S.ENROUTE)
    return found


def ahead(found: Flight) -> list[str]:
    """What the mission still has to do, in order."""
    status = found.status
    return [one.id for one in ([status.target] if status.target else []) + [*status.pending]]


@pytest.mark.parametrize("ordered", [True, False])
def test_waypoints_are_flown_in_the_order_that_was_dragged(*, ordered: bool) -> None:
    """Against their own order and against the scheduler's, which plans anew at each arrival."""
    found = enroute(*row("a", "b", "c", "d"), ordered=ordered)
    assert found.tell(RearrangeNavigation(("d", "b", "c"))).accepted
    assert ahead(found) == ["a", "d", "b", "c"]
    found.run()
    found.expect(S.LANDED)
    assert found.status.visited == ("a", "d", "b", "c")


def test_the_current_waypoint_may_wait() -> None:
    """The drone turns to the one that was dragged before it, and comes back."""
    found = enroute(*row("a", "b"))
    assert found.tell(RearrangeNavigation(("b", "a"))).accepted
    found.run()
    assert found.status.visited == ("b", "a")


def test_removed_waypoints_are_not_flown_to() -> None:
    """Coming ones and the current one; nothing is told as given up or visited."""
    found = enroute(*row("a", "b", "c"))
    answer = found.tell(RearrangeNavigation(("c", "b"), ("a",)))
    assert answer.accepted
    assert not answer.refused
    assert ahead(found) == ["c", "b"]
    found.run()
    found.expect(S.LANDED)
    assert (found.status.visited, found.status.given_up) == (("c", "b"), ())


def test_what_was_reached_meanwhile_is_not_flown_again() -> None:
    """The order was dragged before the page knew; the rest of it counts, and the answer says so."""
    found = enroute(*row("a", "b", "c"))
    found.run(until=lambda: "a" in found.status.visited)
    answer = found.tell(RearrangeNavigation(("c", "a", "b")))
    assert answer.accepted
    assert answer.refused == {"a": "a was reached meanwhile"}
    found.run()
    assert found.status.visited == ("a", "c", "b")


def test_a_waypoint_at_which_the_drone_hovers_stays() -> None:
    """To leave it and come back for the rest of its hover would be to fly there twice."""
    found = enroute(*row("a", "b", "c", hover=3.0))
    found.run_to(S.LOITERING)
    answer = found.tell(RearrangeNavigation(("c", "a"), ("b",)))
    assert answer.accepted
    assert answer.refused == {"a": "the drone is at a by now"}
    assert ahead(found) == ["a", "c"]
    assert not found.tell(RearrangeNavigation((), ("a",))).accepted
    found.run()
    assert found.status.visited == ("a", "c")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (RearrangeNavigation(), "nothing was named"),
        (RearrangeNavigation(("ghost",)), "ghost is not in the plan"),
        (RearrangeNavigation(("b", "b")), "b: named more than once"),
        (RearrangeNavigation(("b",), ("b",)), "b: named more than once"),
        (RearrangeNavigation(("b", "now")), "'now' is more urgent than 'b'"),
        (RearrangeNavigation(("b", "now"), ("c",)), "'now' is more urgent than 'b'"),
    ],
)
def test_what_makes_no_sense_changes_nothing(command: RearrangeNavigation, said: str) -> None:
    """Whole or not at all: nothing is removed where the order is refused."""
    found = enroute(*row("a", "b", "c"), Waypoint("now", 0, 50, 1.5, priority=1))
    before = ahead(found)
    answer = found.tell(command)
    assert not answer.accepted
    assert said in answer.text
    assert ahead(found) == before


def test_a_drone_that_leaves_is_not_rearranged() -> None:
    """It comes home whatever its plan was."""
    found = enroute(*row("a", "b"))
    found.tell(ReturnHome())
    assert found.tell(RearrangeNavigation(("b", "a"))).text == "the drone is returning by now"


def test_later_waypoints_are_planned_around_those_that_were_dragged() -> None:
    """What the scheduler would fly first comes after them."""
    found = enroute(*row("a", "b", "c"), ordered=False)
    found.tell(RearrangeNavigation(("c", "b")))
    found.tell(add(Waypoint("near", 6, 0, 1.5), ordered=False))
    found.run()
    assert found.status.visited == ("a", "c", "b", "near")


@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_nothing_is_lost_and_nothing_comes_twice(data: st.DataObject) -> None:
    """The order named is that of the named ones; all others keep their places."""
    queue = WaypointQueue()
    names = [f"w{n}" for n in range(data.draw(st.integers(1, 8)))]
    queue.add([Waypoint(name, 0, 0, 0) for name in names])
    order = data.draw(st.lists(st.sampled_from(names), unique=True))
    rest = [name for name in names if name not in order]
    removed = data.draw(st.lists(st.sampled_from(rest), unique=True)) if rest else []
    queue.rearrange(order, removed)
    now = [stop.id for stop in queue]
    assert sorted(now) == sorted(set(names) - set(removed))
    assert [name for name in now if name in order] == order
    kept = [name for name in names if name not in removed]
    assert all(now[n] == name for n, name in enumerate(kept) if name not in order)
