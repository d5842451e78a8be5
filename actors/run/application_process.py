"""The application as its orphan reaper sees it: a process here, or one of another machine."""

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
    """Made by the application itself, and looked after by another process."""

    lockstep: bool
    """Its drones are simulated, and fly no faster than it can follow."""
    node: str = field(default_factory=lambda: ray.get_runtime_context().get_node_id())
    pid: int = field(default_factory=os.getpid)
    pids: str = field(default_factory=_pid_namespace)
    """The namespace of its number; a container's own, or empty where there are none."""
    began: float = field(default_factory=lambda: psutil.Process().create_time())

    @property
    def near(self) -> bool:
        """Whether this process runs beside it, and so can see whether it lives."""
        here: str = ray.get_runtime_context().get_node_id()
        return here == self.node and _pid_namespace() == self.pids

    def ended(self) -> bool:
        """Whether it has ended, for a caller on the same machine."""
        try:
            process = psutil.Process(self.pid)
            # A number may be used again.
            again = process.create_time() != self.began
            return bool(again or process.status() == psutil.STATUS_ZOMBIE)
        except psutil.NoSuchProcess:
            return True
