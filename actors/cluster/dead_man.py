"""Self-termination of actor processes that were told to stop.

An actor is ended through the head of its cluster. Without a reachable head, a stopped process
would remain for ever, so it ends itself.
"""

from __future__ import annotations

import os
import threading

import ray
import ray.actor

__all__ = ["LAST_SECONDS", "exit_actor", "exit_soon"]

LAST_SECONDS = 30.0
"""Wall seconds from the stop command until the process ends: longer than a head needs to end it,
and than current work takes to finish."""


def exit_soon(seconds: float = LAST_SECONDS) -> None:
    """End this process after `seconds`, if it is an actor's."""
    if ray.is_initialized() and ray.get_runtime_context().get_actor_id():
        timer = threading.Timer(seconds, os._exit, (0,))
        timer.daemon = True
        timer.start()


def exit_actor() -> None:
    """End this actor through Ray, so that it is not restarted; to be called in an actor's method.

    This may need the cluster's head, so the process also ends by its own timer.
    """
    exit_soon()
    ray.actor.exit_actor()
