"""Self-termination of a process that no other process can end any more.

An actor is ended through the head of its cluster. Where that is lost, a process that was told to
stop would stay for ever, so it ends itself.
"""

from __future__ import annotations

import os
import threading

import ray
import ray.actor

__all__ = ["LAST_SECONDS", "exit_soon", "leave"]

LAST_SECONDS = 30.0
"""Wall seconds from being told to stop until the process ends: longer than a head needs to end it,
and than what is under way takes to finish."""


def exit_soon(seconds: float = LAST_SECONDS) -> None:
    """End this process in so many seconds, if it is an actor's."""
    if ray.is_initialized() and ray.get_runtime_context().get_actor_id():
        timer = threading.Timer(seconds, os._exit, (0,))
        timer.daemon = True
        timer.start()


def leave() -> None:
    """End this actor, whose call it must be, in Ray's own way: then it is not restarted.

    That may take its head to be reached, so the process ends soon in any case.
    """
    exit_soon()
    ray.actor.exit_actor()
