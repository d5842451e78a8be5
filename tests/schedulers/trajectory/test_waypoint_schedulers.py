"""What every trajectory scheduler promises, and what each of them adds."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from waypoint_fields import HOME, in_a_hurry, places, scatter, waypoints

from aerodaas.config.plugins import load_plugin
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.navigation.planner import PlanRequest, solve
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler
from aerodaas.schedulers.trajectory.deadline import DeadlineScheduler
from aerodaas.schedulers.trajectory.exact import shortest_order
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler
from aerodaas.schedulers.trajectory.priority import PriorityScheduler
from aerodaas.schedulers.trajectory.travel import TravelCosts

NAMES = ["ordered", "nearest_neighbor", "priority", "deadline"]


@pytest.mark.parametrize("name", NAMES)
@given(points=places)
@settings(max_examples=25)
def test_a_plan_is_a_permutation(name: str, points: list[tuple[float, float, float]]) -> None:
    """Nothing is lost and nothing is visited twice where nothing forbids it."""
    pending = waypoints(points)
    order = load_plugin("trajectory_schedulers", name)().plan(pending, HOME)
    assert sorted(w.id for w in order) == sorted(w.id for w in pending)


@given(points=places.filter(lambda points: len(points) <= 6))
@settings(max_examples=25)
def test_exact_equals_brute_force(points: list[tuple[float, float, float]]) -> None:
    """Dynamic programming finds the least of all permutations, with a group in its order."""
    pending = waypoints(points)
    travel = TravelCosts.of(pending, HOME)
    group = list(range(0, len(pending), 2))
    least = min(
        travel.cost(order, travel.distance)
        for order in itertools.permutations(range(len(pending)))
        if [i for i in order if i in group] == group
    )
    order = shortest_order(travel.distance, [group])
    assert order is not None
    assert [i for i in order if i in group] == group
    assert travel.cost(order, travel.distance) == pytest.approx(least)


def test_nearest_neighbor_keeps_groups() -> None:
    """A later member of an ordered group waits for the earlier one, however near it is."""
    pending = waypoints([(30, 0, 1), (1, 0, 1), (10, 0, 1)])
    situation = PlanningContext(0.0, np.zeros(3), np.zeros(3), ordered=(("w0", "w1"),))
    plan = NearestNeighborScheduler().plan(pending, situation)
    assert [w.id for w in plan] == ["w2", "w0", "w1"]


def test_priority_then_deadline_then_nearness() -> None:
    """The sort keys in their order."""
    pending = [
        Waypoint("far", 50, 0, 1),
        Waypoint("near", 5, 0, 1),
        Waypoint("soon", 90, 0, 1, deadline=99.0),
        Waypoint("urgent", 70, 0, 1, priority=1),
    ]
    plan = PriorityScheduler().plan(pending, HOME)
    assert [w.id for w in plan] == ["urgent", "soon", "far", "near"]


def test_deadlines_are_kept_where_they_can_be() -> None:
    """Going the long way round is the only way to be in time."""
    plan = list(DeadlineScheduler().plan(in_a_hurry(), HOME))
    assert TravelCosts.of(plan, HOME).is_punctual(range(3))
    assert plan[0].id == "other"


def test_deadline_scheduler_puts_off_what_is_late() -> None:
    """Two of three can be in time: the third is visited all the same."""
    pending = [
        Waypoint("a", 10, 0, 0, waypoint_type="local", deadline=6.0),
        Waypoint("far", -100, 0, 0, waypoint_type="local", deadline=50.0),
        Waypoint("b", 20, 0, 0, waypoint_type="local", deadline=51.0),
    ]
    plan = [w.id for w in DeadlineScheduler().plan(pending, HOME)]
    assert plan == ["a", "b", "far"]


class _Broken(TrajectoryScheduler):
    def __init__(self, answer: str) -> None:
        super().__init__()
        self._answer = answer

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:
        if self._answer == "raises":
            raise ZeroDivisionError(situation.now)
        if self._answer == "twice":
            return [*pending, pending[0]]
        return [*pending, Waypoint("invented", 0, 0, 0)]


@pytest.mark.parametrize("answer", ["raises", "twice", "invents"])
def test_a_broken_plugin_keeps_the_order_given(answer: str) -> None:
    """Whatever a plug-in does, the mission gets an order that it can fly, and a reason."""
    pending = tuple(scatter(3))
    plan = solve(_Broken(answer), PlanRequest(0, 5, pending, HOME))
    assert plan.order == pending
    assert "_Broken failed" in plan.fault
