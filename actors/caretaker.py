"""The caretaker: ends the actors of a run whose application has died, once the drones are down.

In a cluster that outlives the application, the actors of a run are detached from it, so that a
killed application does not take the drone's actor with it. The drone's actor brings the drone
home by itself; the caretaker sees to it that nothing is left running afterwards.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import ray
from ray.exceptions import GetTimeoutError, RayActorError

from aerodaas.actors._ending import end_actors

__all__ = ["Caretaker"]

_LAUNCH = 200.0
"""Wall seconds that an application has to start its run, before its first word."""
_SILENCE = 5.0
"""Wall seconds without a word from the application after which it is taken for dead."""
_ANSWER_TIMEOUT = 5.0
_LOOK_INTERVAL = 1.0


class Caretaker:
    """Watches one run; needs two calls at a time, `watch` and `heard`."""

    def __init__(self) -> None:
        """Begin to listen."""
        self._silent_from = time.monotonic() + _LAUNCH

    def heard(self) -> None:
        """Note that the application is alive."""
        self._silent_from = time.monotonic() + _SILENCE

    def watch(
        self, drones: Sequence[Any], groups: Sequence[Sequence[Any]], helpers: Sequence[Any]
    ) -> None:
        """Wait until the application is gone and none of the `drones` flies; then end everything.

        `groups` are stopped in turn, the `helpers` killed.
        """
        while time.monotonic() < self._silent_from or any(map(self._may_fly, drones)):
            time.sleep(_LOOK_INTERVAL)
        end_actors(groups, helpers)
        ray.actor.exit_actor()

    @staticmethod
    def _may_fly(drone: Any) -> bool:  # noqa: ANN401 - an actor's handle
        try:
            return bool(ray.get(drone.report.remote(), timeout=_ANSWER_TIMEOUT).phase == "running")
        except RayActorError:
            return False
        except GetTimeoutError:
            return True
