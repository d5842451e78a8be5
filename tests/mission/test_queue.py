"""The waypoint queue: nothing is lost, nothing comes twice, urgency decides."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from aerodaas.errors import InvalidWaypointError
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.navigation.queue import WaypointQueue


def waypoint(name: str, priority: int = 5, hover: float = 0.0) -> Waypoint:
    """A waypoint somewhere."""
    return Waypoint(name, 0, 0, 0, hover, priority=priority)


def ids(queue: WaypointQueue) -> list[str]:
    """Ids in the order of service."""
    return [stop.id for stop in queue]


class QueueMachine(RuleBasedStateMachine):
    """Random additions, visits, plans and clears, against a plain set of what must be there."""

    def __init__(self) -> None:
        """Start with an empty queue."""
        super().__init__()
        self.queue = WaypointQueue()
        self.expected: set[str] = set()
        self.groups: dict[str, list[str]] = {}
        self.pinned: set[str] = set()
        self.count = 0

    @rule(
        priorities=st.lists(st.integers(1, 3), min_size=1, max_size=4),
        index=st.none() | st.integers(0, 6),
        ordered=st.booleans(),
    )
    def add(self, priorities: list[int], index: int | None, ordered: bool) -> None:  # noqa: FBT001
        """Add a few waypoints, perhaps as a group, perhaps at an index."""
        group = f"g{self.count}" if ordered and index is None else None
        added = [waypoint(f"w{self.count + i}", p) for i, p in enumerate(priorities)]
        self.count += len(added)
        self.queue.add(added, group=group, index=index)
        self.expected |= {one.id for one in added}
        if index is not None:
            self.pinned |= {one.id for one in added}
        if group:
            self.groups[group] = [one.id for one in added]

    @rule()
    def visit(self) -> None:
        """Serve the head."""
        head = self.queue.head
        if head is not None:
            head.under_way = True
            assert self.queue.remove(head.id) is head
            self.expected.remove(head.id)

    @rule(data=st.data())
    def plan(self, data: st.DataObject) -> None:
        """Reorder what may move, leaving some out; some may have come since."""
        asked = [stop.id for stop in self.queue.movable()]
        level = self.queue.level
        if level is None:
            return
        pinned = {i: name for i, name in enumerate(ids(self.queue)) if name in self.pinned}
        order = data.draw(st.permutations(asked))
        kept = order[: data.draw(st.integers(0, len(order)))]
        given_up = self.queue.reorder(level, asked, kept)
        assert set(given_up) == set(asked) - set(kept)
        self.expected -= set(given_up)
        if not given_up:
            now = ids(self.queue)
            assert all(now[i] == name for i, name in pinned.items())

    @rule()
    def clear(self) -> None:
        """Forget everything."""
        before = self.queue.epoch
        assert set(self.queue.clear()) == self.expected
        assert self.queue.epoch > before
        self.expected.clear()

    @invariant()
    def holds_exactly_what_is_expected(self) -> None:
        """Nothing lost, nothing twice."""
        assert sorted(ids(self.queue)) == sorted(self.expected)
        assert len(self.queue) == len(self.expected)

    @invariant()
    def urgency_decides(self) -> None:
        """Priorities never fall along the queue."""
        priorities = [stop.waypoint.priority for stop in self.queue]
        assert priorities == sorted(priorities)

    @invariant()
    def groups_keep_their_order(self) -> None:
        """Members of a group and of one priority come in the order given."""
        place = {stop.id: (stop.waypoint.priority, i) for i, stop in enumerate(self.queue)}
        for members in self.groups.values():
            for priority in (1, 2, 3):
                left = [place[m][1] for m in members if m in place and place[m][0] == priority]
                assert left == sorted(left)


TestQueueMachine = QueueMachine.TestCase


@given(st.integers(0, 5))
def test_an_index_counts_from_the_next(index: int) -> None:
    """The waypoint comes after that many others."""
    queue = WaypointQueue()
    queue.add([waypoint(f"w{i}") for i in range(5)])
    queue.add([waypoint("x"), waypoint("y")], index=index)
    assert ids(queue)[index : index + 2] == ["x", "y"]


def test_a_plan_of_a_level_that_was_served_meanwhile_changes_nothing() -> None:
    """Its last waypoint was visited, or has become more urgent, before the plan was made."""
    queue = WaypointQueue()
    queue.add([waypoint("a"), waypoint("b", priority=2)])
    assert queue.reorder(7, ["gone"], ["gone"]) == []
    assert ids(queue) == ["b", "a"]
    assert queue.level == 2
    queue.remove("b")
    queue.remove("a")
    assert queue.reorder(2, ["b"], []) == []
    assert not len(queue)
    assert queue.head is None


def test_an_interrupted_stop_keeps_its_remaining_hover() -> None:
    """A more urgent waypoint takes the turn; the old one comes back with what is left."""
    queue = WaypointQueue()
    queue.add([waypoint("plan", hover=5.0)])
    head = queue.head
    assert head is not None
    head.under_way, head.remaining_hover = True, 2.0
    queue.add([waypoint("event", priority=1)])
    assert ids(queue) == ["event", "plan"]
    assert queue.interrupted
    queue.remove("event")
    assert ids(queue) == ["plan"]
    assert head.remaining_hover == 2.0


def test_ids_are_unique_and_a_moving_target_replaces_itself() -> None:
    """A second waypoint of an id is refused, unless the stream that made it moves its target."""
    queue = WaypointQueue()
    queue.add([waypoint("a"), waypoint("b")], source="drone/follow")
    with pytest.raises(InvalidWaypointError, match="'a' is already queued"):
        queue.add([waypoint("c"), waypoint("a")])
    assert ids(queue) == ["a", "b"]
    queue.add([Waypoint("a", 9, 9, 9)], source="drone/follow")
    assert ids(queue) == ["a", "b"]
    assert queue.head is not None
    assert queue.head.waypoint.x == 9
    queue.add([waypoint("b", priority=1)], source="drone/follow")
    assert ids(queue) == ["b", "a"]
    with pytest.raises(InvalidWaypointError, match="negative"):
        queue.add([waypoint("z")], index=-1)
