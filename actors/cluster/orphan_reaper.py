"""Orphan reaper: ends the actors of a run whose application has died, after the drones' landing.

The actors of a run are detached from the application, so that the drone's actor survives a
killed application. The drone's actor brings the drone home by itself; the orphan reaper ends
all remaining actors afterwards.

It is a thread of the actor that is ended last: the recorder's, which records the end of the
others, or of one of its own in a run that is not recorded.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
import ray

from aerodaas.actors.cluster.dead_man import exit_actor, exit_soon
from aerodaas.actors.cluster.ray_process import RunLock
from aerodaas.actors.run.shutdown import end_actors, may_fly

__all__ = ["REAPER", "ApplicationProcess", "OrphanReaperActor", "ReaperHost", "Watched"]

REAPER = "reaper"
"""Concurrency group of an actor for the calls to its reaper, which its own work must not block."""
_LAUNCH = 200.0
"""Wall seconds that an application has to start its run, before its first heartbeat."""
_SILENCE = 5.0
"""Wall seconds without a heartbeat after which the application is considered dead."""
_LOOK_INTERVAL = 1.0


def _pid_namespace() -> str:
    try:
        return str(Path("/proc/self/ns/pid").readlink())
    except OSError:
        return ""


@dataclass(frozen=True)
class ApplicationProcess:
    """The application's process: created by the application, checked by the reaper."""

    time_waits: bool
    """Whether mission time stands while it does: its drones are simulated and cannot fall."""
    node: str = field(default_factory=lambda: ray.get_runtime_context().get_node_id())
    pid: int = field(default_factory=os.getpid)
    pids: str = field(default_factory=_pid_namespace)
    """PID namespace of the process, such as a container's; empty if there are none."""
    began: float = field(default_factory=lambda: psutil.Process().create_time())

    @property
    def near(self) -> bool:
        """Whether the calling process runs on the same node and PID namespace."""
        here: str = ray.get_runtime_context().get_node_id()
        return here == self.node and _pid_namespace() == self.pids

    def ended(self) -> bool:
        """Whether it has ended; valid only if `near`."""
        try:
            process = psutil.Process(self.pid)
            # A process id may be reused.
            again = process.create_time() != self.began
            return bool(again or process.status() == psutil.STATUS_ZOMBIE)
        except psutil.NoSuchProcess:
            return True


@dataclass(frozen=True)
class Watched:
    """The processes and actors that a reaper watches and ends, its own actor excepted."""

    application: ApplicationProcess
    drones: Sequence[Any]
    """Actors that must not be ended while they fly, unless their time waits for the application."""
    actors: Sequence[Any]
    """Actors to be stopped before the reaper's own."""
    helpers: Sequence[Any]
    """Actors without streams, to be killed at the end."""


class ReaperHost:
    """Mixin of an actor in which the orphan reaper of its run lives.

    Its reaper watches once it is constructed, also by a restart: a start call could be lost.
    """

    def __init__(self, watched: Watched) -> None:
        self._reaper = _OrphanReaper(watched)

    def heard(self) -> None:
        """Record a heartbeat of the application; with the first its run begins.

        Before, a local Ray ends with the application; from now on it stays until the run has ended.
        """
        self._reaper.heard()

    def ending(self) -> bool:
        """Whether the reaper is ending the run, or has ended it."""
        return self._reaper.ending


class OrphanReaperActor(ReaperHost):
    """Actor for the reaper alone, of a run that is not recorded."""

    def resolve_address(self) -> None:
        """Do nothing: the call makes Ray resolve the actor's address for the caller."""

    def stop(self) -> None:
        """Prepare to end: the process ends soon afterwards, at the latest by its own timer."""
        exit_soon()

    def exit(self) -> None:
        """End the process; called after `stop`."""
        exit_actor()


class _OrphanReaper:
    """Watchdog of one run in a thread of its own."""

    def __init__(self, watched: Watched) -> None:
        self.ending = False
        self._application = watched.application
        self._drones = () if watched.application.time_waits else watched.drones
        self._itself = ray.get_runtime_context().current_actor
        self._lock: RunLock | None = None
        self._silent_from = time.monotonic() + _LAUNCH
        self._actors, self._helpers = watched.actors, watched.helpers
        for actor in (*self._actors, *self._helpers):
            # An actor's address is resolved once, by the cluster's head, which may be lost later.
            actor.resolve_address.remote()
        threading.Thread(target=self._watch, name="orphan reaper", daemon=True).start()

    def heard(self) -> None:
        if self._lock is None:
            self._lock = RunLock()
        self._silent_from = time.monotonic() + _SILENCE

    def _watch(self) -> None:
        while not self._gone() or any(map(may_fly, self._drones)):
            time.sleep(_LOOK_INTERVAL)
        self.ending = True
        # The last of them is its own: the process ends, which releases the lock.
        end_actors((self._actors, [self._itself]), self._helpers)

    def _gone(self) -> bool:
        if not self._application.near:
            return time.monotonic() > self._silent_from
        if self._application.ended():
            return True
        # A suspended application has lost its drones, unless their time stands still, too.
        return not self._application.time_waits and time.monotonic() > self._silent_from
