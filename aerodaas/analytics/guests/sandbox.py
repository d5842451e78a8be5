"""Sandbox of a guest's process: what it does to itself before any of the guest's code is loaded.

It imports the standard library only, because a new user namespace needs a process of one thread.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import os
import pwd
import resource
import signal
import socket
import sys
from pathlib import Path

from aerodaas.analytics.guests.channel import Channel
from aerodaas.analytics.guests.namespaces import enter_namespaces

__all__ = ["main"]

_NICENESS = 15
_FILES = 256
_FILE_BYTES = 64 << 20
_DEATH_SIGNAL = 1
_NO_NEW_PRIVILEGES = 38


def main(number: int, memory: int, cpu: int, served_by: str) -> None:
    """Confine this process, then let the module `served_by` serve the channel.

    Args:
        number: File descriptor of the channel.
        memory: Most megabytes of private memory.
        cpu: Most seconds of processor time; 0 for no limit.
        served_by: Module whose `serve(channel)` runs the guest's code.
    """
    channel = Channel(socket.socket(fileno=number))
    libc = ctypes.CDLL(None, use_errno=True)
    _limit(memory, cpu)
    isolated = enter_namespaces(
        lambda inside: channel.send({"process": inside, "isolated": True}),
        Path(os.environ["HOME"]),
        Path(pwd.getpwuid(os.getuid()).pw_dir),
    )
    libc.prctl(_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    if not isolated:
        channel.send({"process": os.getpid(), "isolated": False})
    # The channel is the only way out: what the guest prints goes to standard error.
    importlib.import_module(served_by).serve(channel)


def _limit(memory: int, cpu: int) -> None:
    limits = {
        resource.RLIMIT_DATA: memory << 20,
        resource.RLIMIT_NOFILE: _FILES,
        resource.RLIMIT_FSIZE: _FILE_BYTES,
        resource.RLIMIT_CORE: 0,
    }
    if cpu:
        limits[resource.RLIMIT_CPU] = cpu
    for kind, most in limits.items():
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(kind, (most, most))
    os.nice(_NICENESS)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
