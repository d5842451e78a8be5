"""What every trajectory scheduler promises, and what each of them adds."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.errors import SchedulerError
from aerodaas.navigation.energy import EnergyModel
from aerodaas.navigation.planner import PlanRequest, solve
from aerodaas.plugins import load_plugin
from aerodaas.schedulers.waypoint.base import Situation, TrajectoryScheduler
from aerodaas.schedulers.waypoint.deadline import DeadlineScheduler
from aerodaas.schedulers.waypoint.exact import shortest_order
from aerodaas.schedulers.waypoint.fleet import share_out
from aerodaas.schedulers.waypoint.nearest_neighbor import NearestNeighborScheduler
from aerodaas.schedulers.waypoint.optimal import OptimalScheduler
from aerodaas.schedulers.waypoint.priority import PriorityScheduler
from aerodaas.schedulers.waypoint.travel import Travel, tour_length
from aerodaas.waypoints import Waypoint

NAMES = ["ordered", "nearest_neighbor", "priority", "deadline", "optimal"]
HOME = Situation(0.0, np.zeros(3), np.zeros(3), speed=2.0)

places = st.lists(
    st.tuples(*[st.integers(-50, 50)] * 2, st.integers(1, 20)), max_size=9, unique=True
)


def waypoints(points: Sequence[tuple[float, float, float]]) -> list[Waypoint]:
    """Waypoints at these places."""
    return [Waypoint(f"w{i}", x, y, z, waypoint_type="local") for i, (x, y, z) in enumerate(points)]


def scatter(count: int, seed: int = 0, side: float = 100.0) -> list[Waypoint]:
    """Random waypoints at 10 m."""
    points = np.random.default_rng(seed).uniform(-side / 2, side / 2, (count, 2))
    return waypoints([(x, y, 10.0) for x, y in points])


@pytest.mark.parametrize("name", NAMES)
@given(points=places)
@settings(max_examples=25, deadline=None)
def test_a_plan_is_a_permutation(name: str, points: list[tuple[float, float, float]]) -> None:
    """Nothing is lost and nothing is visited twice where nothing forbids it."""
    pending = waypoints(points)
    order = load_plugin("waypoint_schedulers", name)().plan(pending, HOME)
    assert sorted(w.id for w in order) == sorted(w.id for w in pending)


@given(points=places)
@settings(max_examples=40, deadline=None)
def test_optimal_is_never_longer_than_nearest_neighbor(
    points: list[tuple[float, float, float]],
) -> None:
    """The exact way is at most as long as the greedy one."""
    pending = waypoints(points)
    best = tour_length(OptimalScheduler().plan(pending, HOME), HOME)
    assert best <= tour_length(NearestNeighborScheduler().plan(pending, HOME), HOME) + 1e-6


@pytest.mark.parametrize("count", [4, 14])
def test_of_two_directions_the_given_one_is_flown(count: int) -> None:
    """A round trip is as long backwards; people expect the first waypoint first."""
    turns = np.linspace(0, 2 * np.pi, count, endpoint=False)[1:]
    pending = waypoints([(50 * np.cos(a), 50 * np.sin(a), 5) for a in turns])
    start = np.array([50.0, 0.0, 5.0])
    plan = OptimalScheduler(budget=0.1).plan(pending, Situation(0.0, start, start))
    assert list(plan) == pending


@given(points=places.filter(lambda points: len(points) <= 6))
@settings(max_examples=25, deadline=None)
def test_exact_equals_brute_force(points: list[tuple[float, float, float]]) -> None:
    """Dynamic programming finds the least of all permutations, with a group in its order."""
    pending = waypoints(points)
    travel = Travel.of(pending, HOME)
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


def test_pyvrp_improves_on_nearest_neighbor_at_size() -> None:
    """Beyond the exact size, the plan is clearly shorter than the greedy one, and complete."""
    pending = scatter(40)
    plan = OptimalScheduler(budget=0.3).plan(pending, HOME)
    assert {w.id for w in plan} == {w.id for w in pending}
    greedy = tour_length(NearestNeighborScheduler().plan(pending, HOME), HOME)
    assert tour_length(plan, HOME) < 0.95 * greedy


def test_nearest_neighbor_keeps_groups() -> None:
    """A later member of an ordered group waits for the earlier one, however near it is."""
    pending = waypoints([(30, 0, 1), (1, 0, 1), (10, 0, 1)])
    situation = Situation(0.0, np.zeros(3), np.zeros(3), ordered=(("w0", "w1"),))
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


@pytest.mark.parametrize("scheduler", [DeadlineScheduler(), OptimalScheduler()])
def test_deadlines_are_kept_where_they_can_be(scheduler: TrajectoryScheduler) -> None:
    """Going the long way round is the only way to be in time, and both find it."""
    pending = [
        Waypoint("near", 10, 0, 0, waypoint_type="local", hover_duration=20),
        Waypoint("other", -10, 0, 0, waypoint_type="local", deadline=6.0),
        Waypoint("third", -20, 0, 0, waypoint_type="local", deadline=60.0),
    ]
    plan = list(scheduler.plan(pending, HOME))
    assert Travel.of(plan, HOME).is_punctual(range(3))
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


def test_optimal_gives_up_what_the_battery_cannot_serve() -> None:
    """As many as possible within the charge, the ones with prizes first, and home again."""
    pending = [*scatter(6, side=20.0), Waypoint("far", 400, 0, 10, waypoint_type="local")]
    model = EnergyModel(endurance=200.0)
    low = Situation(
        0.0, np.zeros(3), np.zeros(3), battery=0.5, speed=2.0, energy=model, reserve=0.1
    )
    plan = OptimalScheduler(budget=0.1).plan(pending, low)
    assert {w.id for w in plan} == {w.id for w in pending} - {"far"}
    assert model.route(low.position, plan, low.home, low.speed) <= 0.4


def test_prizes_decide() -> None:
    """Of two places that exclude each other, the one that is worth more is visited."""
    pending = [Waypoint(k, x, 0, 0, waypoint_type="local") for k, x in [("a", 100), ("b", -90)]]
    model = EnergyModel(endurance=200.0)
    low = Situation(0.0, np.zeros(3), np.zeros(3), battery=0.6, speed=2.0, energy=model)
    assert [w.id for w in OptimalScheduler(budget=0.05).plan(pending, low)] == ["b"]
    valued = OptimalScheduler(prizes={"a": 3.0}, budget=0.05).plan(pending, low)
    assert [w.id for w in valued] == ["a"]


def test_energy_objective_spares_the_upwind_legs() -> None:
    """In wind, the least energy is another way than the shortest one."""
    pending = waypoints([(10.0 * i, 10.5 * j, 5.0) for i in range(3) for j in range(3)])
    model = EnergyModel(endurance=1e4, wind=np.array([8.0, 0.0, 0.0]))
    home = np.array([0.0, 0.0, 5.0])
    situation = Situation(0.0, home, home, speed=6.0, energy=model)
    by_energy, by_distance = (
        model.route(home, scheduler.plan(pending, situation), home, 6.0)
        for scheduler in (OptimalScheduler(objective="energy"), OptimalScheduler())
    )
    assert by_energy < 0.98 * by_distance


@pytest.mark.parametrize(
    "settings_of_it", [{"objective": "fun"}, {"budget": 0.0}, {"prizes": {"a": float("nan")}}]
)
def test_settings_that_make_no_sense_are_refused(settings_of_it: dict[str, object]) -> None:
    """With a SchedulerError, before anything flies."""
    with pytest.raises(SchedulerError):
        OptimalScheduler(**settings_of_it)  # type: ignore[arg-type]


class _Broken(TrajectoryScheduler):
    def __init__(self, answer: str) -> None:
        super().__init__()
        self._answer = answer

    def plan(self, pending: Sequence[Waypoint], situation: Situation) -> Sequence[Waypoint]:
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


def test_a_fleet_shares_and_ends_earlier() -> None:
    """Every waypoint is served once; two drones are home earlier than one."""
    pending = scatter(16)
    left = Situation(0.0, np.array([-50.0, 0, 0]), np.array([-50.0, 0, 0]), speed=2.0)
    right = Situation(0.0, np.array([50.0, 0, 0]), np.array([50.0, 0, 0]), speed=2.0)
    shares = share_out(pending, {"left": left, "right": right}, objective="time", budget=0.8)
    served = [w.id for share in shares.values() for w in share]
    assert sorted(served) == sorted(w.id for w in pending)
    longest = max(
        tour_length(shares[name], drone) for name, drone in {"left": left, "right": right}.items()
    )
    assert longest < 0.8 * tour_length(OptimalScheduler(budget=0.2).plan(pending, left), left)
    with pytest.raises(SchedulerError):
        share_out(pending, {})
