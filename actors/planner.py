"""The trajectory scheduler's actor: plans beside the drone's, which a long plan must not delay."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any, TypeVar

import ray
from ray.exceptions import RayActorError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

__all__ = ["PlannerExecutor"]

T = TypeVar("T")


def _load(*_: object) -> None:
    """Arrive with one's arguments."""


class _PlannerActor:
    """Calls what it is given; holds no state, so that a restart loses nothing."""

    def call(self, function: Callable[..., T], *args: Any) -> T:  # noqa: ANN401
        return function(*args)


class PlannerExecutor(Executor):
    """Runs calls in an actor on this node, which is killed and started anew where it hangs."""

    def __init__(self, patience: float, *used: object) -> None:
        """Give each call `patience` wall seconds; returns when the actor is there.

        The modules of what is `used` later are loaded at once, for it takes seconds.
        """
        here = ray.get_runtime_context().get_node_id()
        remote: Any = ray.remote(_PlannerActor)
        self._actor = remote.options(
            num_cpus=0,
            max_restarts=-1,
            scheduling_strategy=NodeAffinitySchedulingStrategy(here, soft=False),
        ).remote()
        self._patience = patience
        ray.get(self._actor.call.remote(_load, *used))

    def submit(self, function: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:  # noqa: ANN401
        """Call `function` in the actor; the future raises RuntimeError if the actor dies."""
        del kwargs
        result: Future[T] = Future()
        watchdog = threading.Timer(self._patience, self._kill)
        watchdog.daemon = True

        def finish(done: Future[T]) -> None:
            watchdog.cancel()
            error = done.exception()
            if isinstance(error, RayActorError):
                text = (
                    f"the scheduler's actor died, or took longer than {self._patience:.0f} s and "
                    "was stopped; it starts anew"
                )
                result.set_exception(RuntimeError(text))
            elif error is not None:
                result.set_exception(error)
            else:
                result.set_result(done.result())

        # An actor that is starting anew is waited for; its patience counts from when it is there.
        self._actor.call.remote(bool).future().add_done_callback(lambda _: watchdog.start())
        self._actor.call.remote(function, *args).future().add_done_callback(finish)
        return result

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: FBT001, FBT002 - the base's
        """End the actor."""
        del wait, cancel_futures
        with contextlib.suppress(Exception):
            ray.kill(self._actor)

    def _kill(self) -> None:
        with contextlib.suppress(Exception):
            ray.kill(self._actor, no_restart=False)
