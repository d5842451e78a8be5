"""Trajectory scheduler's actor: plans in a process of its own, not to delay the drone's actor."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any, TypeVar

import ray
from ray.exceptions import GetTimeoutError, RayActorError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from aerodaas.actors.priority import be_nice
from aerodaas.actors.run.application import Application
from aerodaas.clock import NANOSECONDS
from aerodaas.mission.navigation.planner import BackgroundPlanner, Planner, solve
from aerodaas.runtime.nodes.controller import RobotSpec
from aerodaas.runtime.session import Session

__all__ = ["PlannerExecutor", "planner_for"]

T = TypeVar("T")

_PLANS_PATIENCE = 4.0
"""Multiple of the plan's timeout after which a scheduler without an answer is stopped."""
_LEAST_PATIENCE = 5.0
"""Least timeout in wall seconds: enough for an actor's restart at any mission speed."""
_NICENESS = 10
"""Niceness of its process: a plan may take longer, but must not delay the setpoint loop."""


class _PlannerActor:
    """Actor that calls functions; stateless, so that a restart loses nothing."""

    def __init__(self, application: Application | None) -> None:
        """Unpickle the application's definitions, also after a restart."""
        del application

    @ray.method(max_task_retries=-1)
    def load(self, *_: object) -> None:
        """Unpickle the arguments, which imports their modules; retried after each restart."""
        be_nice(_NICENESS)

    def call(self, function: Callable[..., T], *args: Any, **kwargs: Any) -> T:  # noqa: ANN401
        return function(*args, **kwargs)


class PlannerExecutor(Executor):
    """Executor of one call after another in an actor on this node, restarted if a call hangs."""

    def __init__(
        self, patience: float, *used: object, application: Application | None = None
    ) -> None:
        """Start the actor and wait for it; each call has a timeout of `patience` wall seconds.

        The modules of the objects `used` later are imported now, because it takes seconds.
        """
        here = ray.get_runtime_context().get_node_id()
        remote: Any = ray.remote(_PlannerActor)
        self._actor = remote.options(
            num_cpus=0,
            max_restarts=-1,
            scheduling_strategy=NodeAffinitySchedulingStrategy(here, soft=False),
        ).remote(application)
        self._patience = patience
        self._caller = ThreadPoolExecutor(1, "planner")
        ray.get(self._actor.load.remote(*used))

    def submit(self, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:  # noqa: ANN401
        """Call a function in the actor.

        Args:
            function: The function.
            *args: Its arguments.
            **kwargs: Its arguments by name.

        Returns:
            A future, which raises RuntimeError if the call hangs or the actor dies.
        """
        return self._caller.submit(self._call, function, args, kwargs)

    def _call(self, function: Callable[..., T], args: tuple[Any, ...], kwargs: dict[str, Any]) -> T:
        try:
            # Wait for a restarting actor: the timeout counts from when it is ready.
            ray.get(self._actor.load.remote())
            done = self._actor.call.remote(function, *args, **kwargs)
            result: T = ray.get(done, timeout=self._patience)
        except GetTimeoutError:
            ray.kill(self._actor, no_restart=False)
            text = f"the scheduler took longer than {self._patience:.0f} s; its actor starts anew"
            raise RuntimeError(text) from None
        except RayActorError:
            raise RuntimeError("the scheduler's actor died; it starts anew") from None
        return result


def planner_for(session: Session, spec: RobotSpec) -> Planner:
    """Create a robot's planner; an isolated scheduler plans in an actor, which starts first.

    Args:
        session: The run.
        spec: The robot, with its trajectory scheduler.
    """
    scheduler = spec.scheduler
    if not scheduler.isolated:
        return BackgroundPlanner(scheduler)
    patience = _PLANS_PATIENCE * spec.robot.mission.plan_timeout
    wall = session.host_seconds(round(patience * NANOSECONDS))
    executor = PlannerExecutor(
        max(_LEAST_PATIENCE, wall), solve, scheduler, application=session.application
    )
    return BackgroundPlanner(scheduler, executor)
