"""Priority of a process that must be punctual: niceness, real time scheduling, locked memory.

Linux knows niceness by thread, so that a process which Ray started niced is raised thread by
thread. Elsewhere nothing is granted, and nothing is asked for.
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
    "Slack",
    "be_nice",
    "lock_memory",
    "lockable_memory",
    "niceness",
    "punctual",
    "raise_niceness",
    "real_time",
]

SWITCH = "AERODAAS_PRIORITY"
"""Environment variable; `off` leaves scheduling as it is, for machines that plan it themselves."""
_REAL_TIME_PRIORITY = 1
"""Of 1 to 99: above all ordinary work, below everything else that has a reason."""
_SWITCH_INTERVAL = 0.001
"""Seconds after which a thread of the interpreter gives way to the loop; Python's own: 5 ms."""
_CURRENT, _ON_FAULT = 1, 4
"""Flags of `mlockall`: present mappings, and of these only touched pages."""
_YOUNG_EVERY = 20
_ALL_EVERY = 600
"""Turns of a loop between two collections of new, and of all, garbage."""


def wanted() -> bool:
    """Whether scheduling is to be changed at all."""
    return os.environ.get(SWITCH, "") != "off"


def niceness() -> int:
    """The niceness of this thread."""
    return os.getpriority(os.PRIO_PROCESS, 0)


def raise_niceness() -> int:
    """Set all threads of this process to normal niceness; returns this thread's niceness."""
    if wanted():
        _set_all(lambda now: min(now, 0))
    return niceness()


def be_nice(level: int) -> None:
    """Let all threads of this process give way to those below niceness `level`."""
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
    """Schedule this thread before all ordinary ones; returns why not, or nothing."""
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
    """Schedule this thread as any other again."""
    if hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(threading.get_native_id(), os.SCHED_OTHER, os.sched_param(0))


def lock_memory() -> str:
    """Lock this process' touched memory; returns the reason of a failure, or nothing.

    What it maps later is not locked, so that it does not grow by what it never uses.
    """
    try:
        library = ctypes.CDLL(None, use_errno=True)
        failed = library.mlockall(_CURRENT | _ON_FAULT)
    except (OSError, AttributeError):
        return f"{sys.platform} has no mlockall"
    return f"memory is not locked: {os.strerror(ctypes.get_errno())}" if failed else ""


def lockable_memory() -> str:
    """Why this process would not be granted locked memory, or nothing."""
    try:
        limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    except (AttributeError, OSError):
        return f"{sys.platform} has no limit for it"
    if os.geteuid() == 0 or limit == resource.RLIM_INFINITY:
        return ""
    return f"memory is locked up to {limit // 1024} KiB only"


class Slack:
    """Collects garbage between the turns of a loop, where there is time, and never in one."""

    def __init__(self) -> None:
        """Nothing has been collected yet."""
        self._turns = 0

    def use(self) -> None:
        """A turn is over, and the next one is not due yet."""
        self._turns += 1
        if self._turns % _ALL_EVERY == 0:
            gc.collect()
        elif self._turns % _YOUNG_EVERY == 0:
            gc.collect(0)


@contextlib.contextmanager
def punctual() -> Iterator[tuple[str, ...]]:
    """Run the loop inside as punctually as this machine grants; yields the refused means.

    Garbage is collected only when asked for (`Slack`), and what is there already never again.
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
