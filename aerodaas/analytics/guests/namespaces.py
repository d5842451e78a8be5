"""Namespaces of a guest's process: no network, no other processes, no shared memory, no writing.

Linux grants them to ordinary users, unless the machine or a container forbids it. Standard library
only, because a new user namespace needs a process of one thread.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

__all__ = ["enter_namespaces"]

_IPC, _MOUNTS, _USER, _PIDS, _NETWORK = 0x08000000, 0x00020000, 0x10000000, 0x20000000, 0x40000000
_PRIVATE, _RECURSIVE, _BIND = 1 << 18, 1 << 14, 1 << 12
_SET_ATTRIBUTES = 442
"""Number of the system call mount_setattr, on x86-64 and aarch64."""
_READ_ONLY, _ALL_BELOW = 1, 0x8000
_DROP_BOUND = 24
_CAPABILITIES = 64
_CAPABILITY_VERSION = 0x20080522
_SIZE = b"size=64m,mode=0700"


def enter_namespaces(told: Callable[[int], None], home: Path, owners: Path) -> bool:
    """Continue as the first process of new namespaces; False where the system forbids them.

    The calling process waits for the one inside and ends with its exit code.

    Args:
        told: Called outside, with the process id of the one inside, before that goes on.
        home: The guest's own folder, empty.
        owners: Home folder of the user, where Ray keeps its token.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    user, group = os.getuid(), os.getgid()
    if libc.unshare(_USER | _PIDS | _NETWORK | _IPC | _MOUNTS):
        return False
    for file, text in {
        "setgroups": "deny",
        "uid_map": f"{user} {user} 1",
        "gid_map": f"{group} {group} 1",
    }.items():
        with contextlib.suppress(OSError):
            Path(f"/proc/self/{file}").write_text(text)
    _hide(libc, home, owners)
    ready, go = os.pipe()
    inside = os.fork()
    if inside:
        told(inside)
        os.write(go, b"1")
        _, status = os.waitpid(inside, 0)
        os._exit(os.waitstatus_to_exitcode(status) & 0xFF)
    os.read(ready, 1)
    os.close(ready)
    os.close(go)
    _drop_capabilities(libc)
    return True


def _hide(libc: ctypes.CDLL, home: Path, owners: Path) -> None:
    """Lay empty folders over those of shared memory and sockets; the rest is only to be read."""
    libc.mount(None, b"/", None, _PRIVATE | _RECURSIVE, None)
    attributes = (ctypes.c_uint64 * 4)(_READ_ONLY, 0, 0, 0)
    libc.syscall(_SET_ATTRIBUTES, -100, b"/", _ALL_BELOW, attributes, ctypes.sizeof(attributes))
    root = Path(__file__).resolve().parents[3]
    working = Path.cwd()
    needed = [Path(sys.prefix), Path(sys.base_prefix), root, working]
    temporary = {Path("/tmp"), home.parent}  # noqa: S108 - hidden
    for folder in [Path("/dev/shm"), owners / ".ray", owners / ".ssh", *temporary]:  # noqa: S108
        if folder.is_dir():
            kept = [one for one in needed if one.is_relative_to(folder) and one != home]
            _lay_over(libc, folder, kept)
    home.mkdir(parents=True, exist_ok=True)
    os.chdir(working)


def _lay_over(libc: ctypes.CDLL, folder: Path, kept: Iterable[Path]) -> None:
    opened = {one: os.open(one, os.O_PATH) for one in kept}
    libc.mount(b"tmpfs", os.fsencode(folder), b"tmpfs", 0, _SIZE)
    for path, number in opened.items():
        with contextlib.suppress(OSError):
            path.mkdir(parents=True, exist_ok=True)
        source = f"/proc/self/fd/{number}".encode()
        libc.mount(source, os.fsencode(path), None, _BIND | _RECURSIVE, None)
        os.close(number)


def _drop_capabilities(libc: ctypes.CDLL) -> None:
    """Give up the rights in the new namespaces, with which the folders could be uncovered."""
    for number in range(_CAPABILITIES):
        libc.prctl(_DROP_BOUND, number, 0, 0, 0)
    header = (ctypes.c_uint32 * 2)(_CAPABILITY_VERSION, 0)
    libc.capset(header, (ctypes.c_uint32 * 6)())
