"""A plan that is made elsewhere answers the very request that was asked."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any, TypeVar

import numpy as np

from aerodaas import OrderedScheduler, Waypoint
from aerodaas.mission.navigation.planner import BackgroundPlanner, PlanRequest
from aerodaas.schedulers.trajectory.base import PlanningContext

T = TypeVar("T")


def _copied(thing: Any) -> Any:  # noqa: ANN401
    return pickle.loads(pickle.dumps(thing))  # noqa: S301 - our own bytes


class Elsewhere(Executor):
    """Calls with copies and returns copies, as another process does."""

    def submit(self, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:  # noqa: ANN401
        """Call at once."""
        result: Future[T] = Future()
        result.set_result(_copied(function(*_copied(args), **kwargs)))
        return result


def test_a_plan_from_another_process_answers_its_request() -> None:
    """Who waits for the plan recognises it, and does not wait in vain."""
    planner = BackgroundPlanner(OrderedScheduler(), Elsewhere())
    situation = PlanningContext(0.0, np.zeros(3), np.zeros(3))
    request = PlanRequest(1, 5, (Waypoint("a", 1, 2, 3), Waypoint("b", 2, 2, 3)), situation)
    planner.submit(request)
    plan = planner.poll()
    assert plan is not None
    assert plan.request is request
    assert [waypoint.id for waypoint in plan.order] == ["a", "b"]
    assert planner.poll() is None
