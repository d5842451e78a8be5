"""Scheduling of time-critical processes: niceness, real-time priority, locked memory.

Linux sets niceness per thread, so a process that Ray started with a higher niceness is changed
thread by thread. Other systems grant no real-time priority and need no change.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import resource
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

__all__ = [
    "SWITCH",
    "IdleGarbageCollector",
    "be_nice",
    "lock_memory",
    "lockable_memory",
    "niceness",
    "punctual",
    "raise_niceness",
    "real_time",
]

SWITCH = "AERODAAS_PRIORITY"
"""Environment variable; `off` leaves scheduling unchanged, for machines that manage it."""
_REAL_TIME_PRIORITY = 1
"""Priority, 1 to 99: above all ordinary threads, below all other real-time ones."""
_SWITCH_INTERVAL = 0.001
"""Seconds after which the interpreter switches threads, for the loop; Python's default: 5 ms."""
_CURRENT, _ON_FAULT = 1, 4
"""Flags of `mlockall`: lock the pages mapped already, and only once they are touched."""
_YOUNG_EVERY = 20
_ALL_EVERY = 600
"""Loop cycles between two garbage collections of all generations; `_YOUNG_EVERY`: of the
youngest."""


def wanted() -> bool:
    """Whether scheduling may be changed (`SWITCH` is not `off`)."""
    return os.environ.get(SWITCH, "") != "off"


def niceness() -> int:
    """Niceness of this thread."""
    return os.getpriority(os.PRIO_PROCESS, 0)


def raise_niceness() -> int:
    """Lower all threads of this process to niceness 0; returns this thread's resulting one."""
    if wanted():
        _set_all(lambda now: min(now, 0))
    return niceness()


def be_nice(level: int) -> None:
    """Raise the niceness of all threads of this process to at least `level`."""
    if wanted():
        _set_all(lambda now: max(now, level))


def _set_all(change: Callable[[int], int]) -> None:
    for thread in _threads():
        with contextlib.suppress(OSError):
            now = os.getpriority(os.PRIO_PROCESS, thread)
            if change(now) != now:
                os.setpriority(os.PRIO_PROCESS, thread, change(now))


def _threads() -> list[int]:
    tasks = Path("/proc/self/task")
    return [int(task.name) for task in tasks.iterdir()] if tasks.is_dir() else [0]


def real_time() -> str:
    """Give this thread real-time priority; returns the reason of a refusal, or ""."""
    if not hasattr(os, "sched_setscheduler"):
        return f"{sys.platform} has no real-time scheduling of threads"
    policy = os.SCHED_RR | getattr(os, "SCHED_RESET_ON_FORK", 0)
    try:
        parameters = os.sched_param(_REAL_TIME_PRIORITY)
        os.sched_setscheduler(threading.get_native_id(), policy, parameters)
    except OSError as error:
        return f"real-time priority is not granted: {error.strerror}"
    return ""


def ordinary() -> None:
    """Return this thread to ordinary scheduling."""
    if hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(threading.get_native_id(), os.SCHED_OTHER, os.sched_param(0))


def lock_memory() -> str:
    """Lock this process's mapped memory once touched; returns the reason of a refusal, or "".

    Later mappings are not locked, so that unused ones take no memory.
    """
    try:
        library = ctypes.CDLL(None, use_errno=True)
        failed = library.mlockall(_CURRENT | _ON_FAULT)
    except (OSError, AttributeError):
        return f"{sys.platform} has no mlockall"
    return f"memory is not locked: {os.strerror(ctypes.get_errno())}" if failed else ""


def lockable_memory() -> str:
    """Reason why locked memory would not be granted to this process, or ""."""
    try:
        limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    except (AttributeError, OSError):
        return f"{sys.platform} has no limit for it"
    if os.geteuid() == 0 or limit == resource.RLIM_INFINITY:
        return ""
    return f"memory is locked up to {limit // 1024} KiB only"


class IdleGarbageCollector:
    """Garbage collection in a loop's slack, between two cycles and never within one."""

    def __init__(self) -> None:
        """Start counting cycles at zero."""
        self._turns = 0

    def use(self) -> None:
        """Collect garbage if due; to be called after a cycle, before the next one is due."""
        self._turns += 1
        if self._turns % _ALL_EVERY == 0:
            gc.collect()
        elif self._turns % _YOUNG_EVERY == 0:
            gc.collect(0)


@contextlib.contextmanager
def punctual() -> Iterator[tuple[str, ...]]:
    """Run the enclosed loop with real-time priority and locked memory; yields the refusals.

    Garbage is collected only explicitly (`Slack`), and existing objects never.
    """
    if not wanted():
        yield ()
        return
    interval = sys.getswitchinterval()
    refused = tuple(why for why in (real_time(), lock_memory()) if why)
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(min(interval, _SWITCH_INTERVAL))
    try:
        yield refused
    finally:
        sys.setswitchinterval(interval)
        gc.enable()
        gc.unfreeze()
        ordinary()
