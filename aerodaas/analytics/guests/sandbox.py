"""Sandbox of a guest's process: what it does to itself before any of the guest's code is loaded.

It imports the standard library only, because a new user namespace needs a process of one thread.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import os
import resource
import signal
import socket
import sys
from pathlib import Path

from aerodaas.analytics.guests.channel import Channel

__all__ = ["main"]

_NICENESS = 15
_FILES = 256
_FILE_BYTES = 64 << 20
_DEATH_SIGNAL = 1
_NO_NEW_PRIVILEGES = 38
_NEW_IPC, _NEW_USER, _NEW_PID, _NEW_NET = 0x08000000, 0x10000000, 0x20000000, 0x40000000


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
    isolated = _enter_namespaces(libc, channel)
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


def _enter_namespaces(libc: ctypes.CDLL, channel: Channel) -> bool:
    """Continue as the first process of namespaces without network and without other processes.

    False where the system does not grant them. The process itself waits for the one inside.
    """
    user, group = os.getuid(), os.getgid()
    if libc.unshare(_NEW_USER | _NEW_PID | _NEW_NET | _NEW_IPC):
        return False
    for file, text in {
        "setgroups": "deny",
        "uid_map": f"{user} {user} 1",
        "gid_map": f"{group} {group} 1",
    }.items():
        with contextlib.suppress(OSError):
            Path(f"/proc/self/{file}").write_text(text)
    ready, go = os.pipe()
    inside = os.fork()
    if inside:
        # Told from outside, by trusted code: to end this process is to end all inside.
        channel.send({"process": inside, "isolated": True})
        os.write(go, b"1")
        channel.close()
        _, status = os.waitpid(inside, 0)
        os._exit(os.waitstatus_to_exitcode(status) & 0xFF)
    os.read(ready, 1)
    os.close(ready)
    os.close(go)
    return True


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
