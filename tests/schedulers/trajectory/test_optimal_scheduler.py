"""The optimal trajectory scheduler, and waypoints shared out over a fleet."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats, integers
from required import needs_python
from waypoint_fields import HOME, in_a_hurry, places, scatter, waypoints

from aerodaas.config.plugins import load_plugin
from aerodaas.errors import SchedulerError
from aerodaas.geometry.energy import EnergyModel
from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext
from aerodaas.schedulers.trajectory.deadline import DeadlineScheduler
from aerodaas.schedulers.trajectory.fleet import share_out
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler
from aerodaas.schedulers.trajectory.optimal import OptimalScheduler
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler
from aerodaas.schedulers.trajectory.travel import TravelCosts, tour_length

needs_solver = needs_python(3, 11, because="PyVRP has no older")


def test_without_the_solver_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything flies; on Python 3.10 there is none."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)  # noqa: ARG005
    with pytest.raises(SchedulerError, match=r"optimal scheduler needs PyVRP.*Python 3\.11"):
        OptimalScheduler()
    with pytest.raises(SchedulerError, match="sharing waypoints out needs PyVRP"):
        share_out(scatter(3), {"drone": HOME})


@needs_solver
@given(points=places)
@settings(max_examples=25)
def test_its_plan_is_a_permutation(points: list[tuple[float, float, float]]) -> None:
    """Nothing is lost and nothing is visited twice where nothing forbids it."""
    pending = waypoints(points)
    order = load_plugin("trajectory_schedulers", "optimal")().plan(pending, HOME)
    assert sorted(w.id for w in order) == sorted(w.id for w in pending)


@needs_solver
def test_it_keeps_deadlines_where_it_can() -> None:
    """Going the long way round is the only way to be in time."""
    plan = list(OptimalScheduler().plan(in_a_hurry(), HOME))
    assert TravelCosts.of(plan, HOME).is_punctual(range(3))
    assert plan[0].id == "other"


@needs_solver
@given(points=places)
@settings(max_examples=40)
def test_optimal_is_never_longer_than_nearest_neighbor(
    points: list[tuple[float, float, float]],
) -> None:
    """The exact way is at most as long as the greedy one."""
    pending = waypoints(points)
    best = tour_length(OptimalScheduler().plan(pending, HOME), HOME)
    assert best <= tour_length(NearestNeighborScheduler().plan(pending, HOME), HOME) + 1e-6


@needs_solver
@pytest.mark.parametrize("count", [4, 14])
def test_of_two_directions_the_given_one_is_flown(count: int) -> None:
    """A round trip is as long backwards; people expect the first waypoint first."""
    turns = np.linspace(0, 2 * np.pi, count, endpoint=False)[1:]
    pending = waypoints([(50 * np.cos(a), 50 * np.sin(a), 5) for a in turns])
    start = np.array([50.0, 0.0, 5.0])
    plan = OptimalScheduler(budget=0.1).plan(pending, PlanningContext(0.0, start, start))
    assert list(plan) == pending


@needs_solver
def test_pyvrp_improves_on_nearest_neighbor_at_size() -> None:
    """Beyond the exact size, the plan is clearly shorter than the greedy one, and complete."""
    pending = scatter(40)
    plan = OptimalScheduler(budget=0.3).plan(pending, HOME)
    assert {w.id for w in plan} == {w.id for w in pending}
    greedy = tour_length(NearestNeighborScheduler().plan(pending, HOME), HOME)
    assert tour_length(plan, HOME) < 0.95 * greedy


@needs_solver
def test_optimal_gives_up_what_the_battery_cannot_serve() -> None:
    """As many as possible within the charge, the ones with prizes first, and home again."""
    pending = [*scatter(6, side=20.0), Waypoint("far", 400, 0, 10, waypoint_type="local")]
    model = EnergyModel(endurance=200.0)
    low = PlanningContext(
        0.0, np.zeros(3), np.zeros(3), battery=0.5, speed=2.0, energy=model, reserve=0.1
    )
    plan = OptimalScheduler(budget=0.1).plan(pending, low)
    assert {w.id for w in plan} == {w.id for w in pending} - {"far"}
    assert model.route(low.position, plan, low.home, low.speed) <= 0.4


@needs_solver
def test_prizes_decide() -> None:
    """Of two places that exclude each other, the one that is worth more is visited."""
    pending = [Waypoint(k, x, 0, 0, waypoint_type="local") for k, x in [("a", 100), ("b", -90)]]
    model = EnergyModel(endurance=200.0)
    low = PlanningContext(0.0, np.zeros(3), np.zeros(3), battery=0.6, speed=2.0, energy=model)
    assert [w.id for w in OptimalScheduler(budget=0.05).plan(pending, low)] == ["b"]
    valued = OptimalScheduler(prizes={"a": 3.0}, budget=0.05).plan(pending, low)
    assert [w.id for w in valued] == ["a"]


@needs_solver
def test_energy_objective_spares_the_upwind_legs() -> None:
    """In wind, the least energy is another way than the shortest one."""
    pending = waypoints([(10.0 * i, 10.5 * j, 5.0) for i in range(3) for j in range(3)])
    model = EnergyModel(endurance=1e4, wind=np.array([8.0, 0.0, 0.0]))
    home = np.array([0.0, 0.0, 5.0])
    situation = PlanningContext(0.0, home, home, speed=6.0, energy=model)
    by_energy, by_distance = (
        model.route(home, scheduler.plan(pending, situation), home, 6.0)
        for scheduler in (OptimalScheduler(objective="energy"), OptimalScheduler())
    )
    assert by_energy < 0.98 * by_distance


@needs_solver
@pytest.mark.parametrize(
    "settings_of_it",
    [
        {"objective": "fun"},
        {"budget": 0.0},
        {"prizes": {"a": float("nan")}},
        {"prizes": {"a": 1e15}},  # beyond what PyVRP can add up
        {"prizes": {"a": -1.0}},
    ],
)
def test_settings_that_make_no_sense_are_refused(settings_of_it: dict[str, object]) -> None:
    """With a SchedulerError, before anything flies."""
    with pytest.raises(SchedulerError):
        OptimalScheduler(**settings_of_it)  # type: ignore[arg-type]


def hurried(count: int, seed: int) -> list[Waypoint]:
    """Waypoints in a field of 200 m, one due every two seconds."""
    xy = np.random.default_rng(seed).uniform(-100.0, 100.0, (count, 2))
    return [
        Waypoint(f"w{i}", x, y, 10.0, deadline=2.0 * (i + 1), waypoint_type="local")
        for i, (x, y) in enumerate(xy.tolist())
    ]


@needs_solver
@given(seed=integers(0, 1000), count=integers(12, 60), charge=floats(0.05, 1.0))
@settings(max_examples=15)
def test_it_is_never_worth_less_than_a_simple_rule(seed: int, count: int, charge: float) -> None:
    """With too little time and charge for all, it serves at least as many."""
    pending = hurried(count, seed)
    model = EnergyModel(endurance=300.0)
    here = PlanningContext(0.0, np.zeros(3), np.zeros(3), battery=charge, speed=5.0, energy=model)
    plan = OptimalScheduler(budget=0.02).plan(pending, here)
    assert TravelCosts.of(plan, here).is_punctual(range(len(plan)))
    assert not plan or model.route(here.position, plan, here.home, here.speed) <= charge + 1e-9
    for rule in (NearestNeighborScheduler(), DeadlineScheduler(), OrderedScheduler()):
        served: list[Waypoint] = []
        for waypoint in rule.plan(pending, here):
            longer = [*served, waypoint]
            punctual = TravelCosts.of(longer, here).is_punctual(range(len(longer)))
            if punctual and model.route(here.position, longer, here.home, here.speed) <= charge:
                served = longer
        assert len(plan) >= len(served)


@needs_solver
def test_many_waypoints_with_deadlines_are_served() -> None:
    """Of 150 that are due every two seconds, those that one rule serves and more."""
    assert len(OptimalScheduler(budget=0.3).plan(hurried(150, 0), HOME)) >= 21
    drones = {"left": HOME, "right": HOME}
    assert sum(map(len, share_out(hurried(150, 0), drones, budget=0.5).values())) >= 21


@needs_solver
def test_a_deadline_of_decades_is_planned_with() -> None:
    """The largest that a waypoint may have, beside a shorter one, is no error in flight."""
    pending = [replace(waypoint, deadline=1e9) for waypoint in scatter(14)]
    assert len(OptimalScheduler(budget=0.05).plan(pending, HOME)) == 14


@needs_solver
def test_a_fleet_shares_and_ends_earlier() -> None:
    """Every waypoint is served once; two drones are home earlier than one."""
    pending = scatter(16)
    left = PlanningContext(0.0, np.array([-50.0, 0, 0]), np.array([-50.0, 0, 0]), speed=2.0)
    right = PlanningContext(0.0, np.array([50.0, 0, 0]), np.array([50.0, 0, 0]), speed=2.0)
    shares = share_out(pending, {"left": left, "right": right}, objective="time", budget=0.8)
    served = [w.id for share in shares.values() for w in share]
    assert sorted(served) == sorted(w.id for w in pending)
    longest = max(
        tour_length(shares[name], drone) for name, drone in {"left": left, "right": right}.items()
    )
    assert longest < 0.8 * tour_length(OptimalScheduler(budget=0.2).plan(pending, left), left)
    with pytest.raises(SchedulerError):
        share_out(pending, {})
