"""The orphan reaper: ends the actors of a run whose application has died, once the drones are down.

The actors of a run are detached from the application, so that one that is killed does not take
the drone's actor with it. The drone's actor brings the drone home by itself; the orphan reaper
sees to it that nothing is left running afterwards.
"""

from __future__ import annotations

import contextlib
import itertools
import threading
import time
from collections.abc import Sequence
from typing import Any

import ray
from ray.exceptions import RayError

from aerodaas.actors.cluster.dead_man import exit_soon, leave
from aerodaas.actors.cluster.run_lock import RunLock
from aerodaas.actors.run.application_process import ApplicationProcess
from aerodaas.actors.run.shutdown import end_actors, may_fly

__all__ = ["OrphanReaper"]

_LAUNCH = 200.0
"""Wall seconds that an application has from its start to its first call."""
_SILENCE = 5.0
"""Wall seconds without a call of the application after which it is taken for dead."""
_LOOK_INTERVAL = 1.0


class OrphanReaper:
    """Watches one run, from its making on: a call might be lost with the application."""

    def __init__(
        self,
        application: ApplicationProcess,
        drones: Sequence[Any],
        groups: Sequence[Sequence[Any]],
        helpers: Sequence[Any],
    ) -> None:
        """Wait until `application` is gone and none of the `drones` flies; then end everything.

        `groups` are stopped in turn, the `helpers` killed. In lockstep, where nothing falls down,
        the drones are not waited for.
        """
        self._ended: tuple[Sequence[Sequence[Any]], Sequence[Any]] = (), ()
        self._ending = False
        self._silent_from = time.monotonic() + _LAUNCH
        self._application = application
        self._drones = drones
        self.look_after(groups, helpers)
        self._lock = RunLock()
        self._itself = ray.get_runtime_context().current_actor
        threading.Thread(target=self._watch, name="orphan_reaper", daemon=True).start()

    def meet(self) -> None:
        """Let its caller learn where it lives."""

    def leave(self) -> None:
        """End the process: the application has ended the run itself."""
        leave()

    def heard(self) -> None:
        """Note that the application is alive."""
        self._silent_from = time.monotonic() + _SILENCE

    def ending(self) -> bool:
        """Whether it ends the run, or has."""
        return self._ending

    def look_after(self, groups: Sequence[Sequence[Any]], helpers: Sequence[Any]) -> None:
        """End these, instead, once it is time to: actors have come in flight."""
        self._ended = groups, helpers
        for actor in (*itertools.chain(*groups), *helpers):
            # Where an actor lives is asked of the cluster's head, once, and that may be lost.
            actor.meet.remote()

    def _watch(self) -> None:
        lockstep = self._application.lockstep
        while not self._gone() or (not lockstep and any(map(may_fly, self._drones))):
            time.sleep(_LOOK_INTERVAL)
        self._ending = True
        end_actors(*self._ended)
        self._lock.release()
        exit_soon()
        with contextlib.suppress(RayError):
            # In Ray's own way, or it would tell the terminal of a worker that died.
            ray.kill(self._itself)

    def _gone(self) -> bool:
        if not self._application.near:
            return time.monotonic() > self._silent_from
        if self._application.ended():
            return True
        # Suspended in real time, it has lost its drones all the same; in lockstep they wait.
        return not self._application.lockstep and time.monotonic() > self._silent_from
