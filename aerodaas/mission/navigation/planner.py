"""Planning beside the setpoint loop, so that a slow plan never delays a setpoint.

The mission submits requests and polls for plans. `InlinePlanner` answers at once, so that runs in
simulated time are deterministic; `BackgroundPlanner` plans on an executor while the drone flies on.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Protocol

from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler

__all__ = [
    "BackgroundPlanner",
    "InlinePlanner",
    "Plan",
    "PlanRequest",
    "Planner",
    "solve",
]


@dataclass(frozen=True, slots=True, eq=False)
class PlanRequest:
    """Waypoints of one priority to be ordered, with their planning context."""

    epoch: int
    """Epoch of the queue; a plan made before the queue was emptied is void."""
    level: int
    """Priority of the waypoints."""
    pending: tuple[Waypoint, ...]
    situation: PlanningContext


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A planner's answer to a request."""

    request: PlanRequest
    order: tuple[Waypoint, ...]
    fault: str = ""
    """Why the scheduler failed and the given order was kept."""


class Planner(Protocol):
    """Protocol of a mission's planner: submit requests, poll for plans."""

    @property
    def replans_on_arrival(self) -> bool:
        """Whether the scheduler replans after each arrival."""
        ...

    def submit(self, request: PlanRequest) -> None:
        """Request a plan; a newer request replaces one that waits."""
        ...

    def poll(self) -> Plan | None:
        """Return a plan that is ready and was not returned yet; never blocks."""
        ...


def solve(scheduler: TrajectoryScheduler, request: PlanRequest) -> Plan:
    """Call the scheduler; any error becomes the plan's fault, never an exception.

    A scheduler is a plug-in that runs in flight: its failure must not endanger the drone.

    Args:
        scheduler: The plug-in that plans.
        request: The waypoints to plan, and the situation.

    Returns:
        The plan; after a fault it keeps the order of the request.
    """
    try:
        answer = scheduler.plan(request.pending, request.situation)
        order, fault = tuple(answer), _objection(request.pending, answer)
    except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
        order, fault = request.pending, f"{type(error).__name__}: {error}"
    if fault:
        return Plan(request, request.pending, f"{type(scheduler).__name__} failed: {fault}")
    return Plan(request, order)


def _objection(pending: Sequence[Waypoint], order: Sequence[Waypoint]) -> str:
    known = {waypoint.id for waypoint in pending}
    answered = [waypoint.id for waypoint in order]
    if len(set(answered)) < len(answered):
        return "its plan visits a waypoint twice"
    unknown = sorted(set(answered) - known)
    return f"its plan visits {', '.join(unknown)}, which were not asked for" if unknown else ""


class _SchedulerPlanner:
    """Base of planners with a scheduler."""

    def __init__(self, scheduler: TrajectoryScheduler) -> None:
        """Plan with `scheduler`."""
        self._scheduler = scheduler

    @property
    def replans_on_arrival(self) -> bool:
        """Whether the scheduler replans after each arrival."""
        return self._scheduler.replans_on_arrival


class InlinePlanner(_SchedulerPlanner):
    """Plans synchronously in `submit`."""

    _plan: Plan | None = None

    def submit(self, request: PlanRequest) -> None:
        """Make the plan now."""
        self._plan = solve(self._scheduler, request)

    def poll(self) -> Plan | None:
        """Return the plan made last, once."""
        plan, self._plan = self._plan, None
        return plan


class BackgroundPlanner(_SchedulerPlanner):
    """Makes one plan at a time on an executor; of the waiting requests, only the newest is kept.

    A process keeps the setpoint loop free of the interpreter lock that long plans hold; the
    scheduler is sent there with each request and so must pickle. Without an executor, a thread is
    used, which suits schedulers that answer within milliseconds.
    """

    def __init__(self, scheduler: TrajectoryScheduler, executor: Executor | None = None) -> None:
        """Plan with `scheduler` on `executor`; None for a thread."""
        super().__init__(scheduler)
        self._executor = executor or ThreadPoolExecutor(1, "planner")
        self._running: Future[Plan] | None = None
        self._request: PlanRequest | None = None
        self._waiting: PlanRequest | None = None

    def submit(self, request: PlanRequest) -> None:
        """Start planning as soon as the current plan is done."""
        self._waiting = request
        if self._running is None:
            self._begin()

    def poll(self) -> Plan | None:
        """Return the plan that is ready, and start on the waiting request."""
        running, request = self._running, self._request
        if running is None or request is None or not running.done():
            return None
        self._running = None
        error = running.exception()
        # A plan made in another process carries a copy of the request.
        plan = (
            replace(running.result(), request=request)
            if error is None
            else Plan(request, request.pending, f"planning failed: {error}")
        )
        self._begin()
        return plan

    def _begin(self) -> None:
        request, self._waiting = self._waiting, None
        if request is None:
            return
        self._request = request
        try:
            self._running = self._executor.submit(solve, self._scheduler, request)
        except RuntimeError as error:  # the executor is shut down or its process has died
            self._running = Future()
            self._running.set_exception(error)
