"""The application as its caretaker sees it: a process here, or one of another machine."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

import psutil
import ray

__all__ = ["ApplicationProcess"]


@dataclass(frozen=True)
class ApplicationProcess:
    """Made by the application itself, and looked after by another process."""

    lockstep: bool
    """Its drones are simulated, and fly no faster than it can follow."""
    node: str = field(default_factory=lambda: ray.get_runtime_context().get_node_id())
    pid: int = field(default_factory=os.getpid)
    began: float = field(default_factory=lambda: psutil.Process().create_time())

    @property
    def near(self) -> bool:
        """Whether this process runs beside it, and so can see whether it lives."""
        return bool(ray.get_runtime_context().get_node_id() == self.node)

    def ended(self) -> bool:
        """Whether it has ended, for who is near."""
        try:
            process = psutil.Process(self.pid)
            # A number may be used again.
            again = process.create_time() != self.began
            return bool(again or process.status() == psutil.STATUS_ZOMBIE)
        except psutil.NoSuchProcess:
            return True
