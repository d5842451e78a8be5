"""Identity of the application's process, for the orphan reaper."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import psutil
import ray

__all__ = ["ApplicationProcess"]


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
