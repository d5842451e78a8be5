"""What the application's scheduler handle records."""

from __future__ import annotations

import pickle

from aerodaas.dataflow.graph import AeroStreamData, Graph, NavigationEdge, Node
from aerodaas.dataflow.navigation import AeroNavigation, PriorityQueue
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import AddNavigation, OpenStream, initial_commands
from aerodaas.schedulers.trajectory.base import NavigationEntry
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler


def stream(name: str, item: type = AeroNavigation) -> AeroStreamData[AeroNavigation]:
    """A stream of a graph of its own."""
    graph = Graph()
    graph.add(Node(name, "analytics", item, None))
    return AeroStreamData(graph, name, item)


def edges(scheduler: NearestNeighborScheduler, *given: AeroNavigation) -> list[NavigationEdge]:
    """As the environment makes them of `navigate(...)` and the scheduler's entries."""
    made = [NavigationEdge("drone", navigation) for navigation in given]
    for entry in scheduler.entries:
        live = entry.navigation.stream
        clear_on = live.name if entry.clear_first and live is not None else None
        index, deadline = entry.index, entry.deadline
        made.append(NavigationEdge("drone", entry.navigation, index, deadline, clear_on))
    return made


def test_search_and_rescue_listing() -> None:
    """clearNavigation, addNavigation(stream), navigate: the stream's first item clears the plan."""
    scheduler = NearestNeighborScheduler()
    plan = scheduler.generate_navigation(AeroNavigation(data=[Waypoint("wp1", 1, 1, 1)]))
    scheduler.clearNavigation()
    scheduler.addNavigation(stream("drone/vip_follow"))
    scheduler.add_navigation(stream("drone/other"))
    commands = initial_commands(edges(scheduler, plan))
    assert commands == [
        AddNavigation(plan),
        OpenStream("drone/vip_follow", clear_first=True),
        OpenStream("drone/other"),
    ]


def test_surveillance_listing_keeps_priorities() -> None:
    """PriorityQueue around a stream ends up as the stream's priority."""
    scheduler = NearestNeighborScheduler()
    scheduler.add_navigation(PriorityQueue(stream("drone/car"), priority=1))
    assert initial_commands(edges(scheduler)) == [OpenStream("drone/car", priority=1)]


def test_clear_on_another_stream() -> None:
    """A stream of detections may empty the queue without feeding it."""
    scheduler = NearestNeighborScheduler()
    scheduler.clear_navigation(on=stream("drone/seen", item=int))
    commands = initial_commands(edges(scheduler))
    assert commands == [OpenStream("drone/seen", feeds=False, clear_first=True)]


def test_clear_on_and_feed_by_the_same_stream() -> None:
    """Written in either order, the stream is opened once, and clears."""
    both = stream("drone/vip")
    scheduler = NearestNeighborScheduler()
    scheduler.clear_navigation(on=both)
    scheduler.add_navigation(both, priority=2)
    commands = initial_commands(edges(scheduler))
    assert commands == [OpenStream("drone/vip", priority=2, clear_first=True)]


def test_in_flight_the_environment_is_told() -> None:
    """Once the mission runs, additions and clears go there and are not kept."""

    class Flying:
        def __init__(self) -> None:
            self.told: list[NavigationEntry] = []

        def navigation_added(self, entry: NavigationEntry) -> bool:
            self.told.append(entry)
            return True

    flying = Flying()
    scheduler = NearestNeighborScheduler(flying)  # type: ignore[arg-type]
    scheduler.add_navigation(AeroNavigation(data=[Waypoint("a", 1, 1, 1)]), index=2, deadline=9.0)
    scheduler.clear_navigation()
    assert not scheduler.entries
    added, cleared = flying.told
    assert (added.index, added.deadline, added.clear_first) == (2, 9.0, False)
    assert cleared.clear_first
    assert not len(cleared.navigation)


def test_a_scheduler_travels_without_its_application() -> None:
    """It is sent to the drone's actor by value."""
    scheduler = NearestNeighborScheduler()
    scheduler.add_navigation(AeroNavigation(data=[Waypoint("a", 1, 1, 1)]))
    assert pickle.loads(pickle.dumps(scheduler)).entries == []  # noqa: S301 - our own bytes
