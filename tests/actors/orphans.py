"""Processes whose parents are killed."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Sequence

import psutil

__all__ = ["until", "until_gone_with_its_parent"]


def until(holds: Callable[[], bool], seconds: float = 30.0) -> None:
    """Wait for something to happen."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.02)


def until_gone_with_its_parent(words: Sequence[str], ready: Callable[[], bool]) -> None:
    """Have another process start a program, kill that one once it is `ready`, and see it end."""
    starting = (
        "import subprocess, time\n"
        f"one = subprocess.Popen({list(words)!r})\n"
        "print(one.pid, flush=True)\ntime.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, "-c", starting], stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        started = psutil.Process(int(parent.stdout.readline()))
        until(ready)
        assert started.is_running()
        parent.kill()
    until(lambda: not started.is_running() or started.status() == psutil.STATUS_ZOMBIE)
