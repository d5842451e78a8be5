"""Orphan reaper: ends the actors of a run whose application has died, after the drones' landing.

The actors of a run are detached from the application, so that the drone's actor survives a
killed application. The drone's actor brings the drone home by itself; the orphan reaper ends
all remaining actors afterwards.
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
"""Wall seconds that an application has to start its run, before its first heartbeat."""
_SILENCE = 5.0
"""Wall seconds without a heartbeat after which the application is considered dead."""
_LOOK_INTERVAL = 1.0


class OrphanReaper:
    """Watchdog of one run, active once constructed: a start call could be lost."""

    def __init__(
        self,
        application: ApplicationProcess,
        drones: Sequence[Any],
        groups: Sequence[Sequence[Any]],
        helpers: Sequence[Any],
    ) -> None:
        """Wait until `application` has ended and none of the `drones` flies; then end all actors.

        `groups` are stopped in turn, the `helpers` killed. Drones whose time waits for the
        application are not waited for.
        """
        self._ended: tuple[Sequence[Sequence[Any]], Sequence[Any]] = (), ()
        self._ending = False
        self._silent_from = time.monotonic() + _LAUNCH
        self._application = application
        self._drones = drones
        self.look_after(groups, helpers)
        self._lock: RunLock | None = None
        self._itself = ray.get_runtime_context().current_actor
        threading.Thread(target=self._watch, name="orphan_reaper", daemon=True).start()

    def meet(self) -> None:
        """Do nothing: the call makes Ray resolve the actor's address for the caller."""

    def leave(self) -> None:
        """End the process: the application has ended the run itself."""
        leave()

    def heard(self) -> None:
        """Record a heartbeat of the application; with the first its run begins.

        Before, a local Ray ends with the application; from now on it stays until the run has ended.
        """
        if self._lock is None:
            self._lock = RunLock()
        self._silent_from = time.monotonic() + _SILENCE

    def ending(self) -> bool:
        """Whether it is ending the run, or has ended it."""
        return self._ending

    def look_after(self, groups: Sequence[Sequence[Any]], helpers: Sequence[Any]) -> None:
        """Replace the actors to be ended, after actors were added in flight."""
        self._ended = groups, helpers
        for actor in (*itertools.chain(*groups), *helpers):
            # An actor's address is resolved once, by the cluster's head, which may be lost later.
            actor.meet.remote()

    def _watch(self) -> None:
        drones = () if self._application.time_waits else self._drones
        while not self._gone() or any(map(may_fly, drones)):
            time.sleep(_LOOK_INTERVAL)
        self._ending = True
        end_actors(*self._ended)
        if self._lock is not None:
            self._lock.release()
        exit_soon()
        with contextlib.suppress(RayError):
            # Through Ray, or it would print a message about a dead worker to the terminal.
            ray.kill(self._itself)

    def _gone(self) -> bool:
        if not self._application.near:
            return time.monotonic() > self._silent_from
        if self._application.ended():
            return True
        # A suspended application has lost its drones, unless their time stands still, too.
        return not self._application.time_waits and time.monotonic() > self._silent_from
