"""A process that must not outlive the one that started it."""

from __future__ import annotations

import os
import signal
import threading

__all__ = ["end_with_starter"]


def end_with_starter() -> None:
    """End this process, and all of its group, once the process that started it is gone.

    Its standard input must be a pipe whose other end its starter alone holds, and leaves alone:
    the system closes that end however the starter ends, also by SIGKILL. (Linux' signal at a
    parent's death goes by the thread that started a process, and reaches no grandchildren.)
    """
    threading.Thread(target=_await_end, name="tie", daemon=True).start()


def _await_end() -> None:
    os.read(0, 1)
    os.killpg(os.getpgrp(), signal.SIGKILL)
