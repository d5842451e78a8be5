"""Supervisor process of a local Ray: runs `ray start`, ends Ray when unused, and cleans up.

It is run as a script, needs the standard library only (10 MB), and is in a session of its own, so
that neither Ctrl-C nor a `kill -9` of the application ends it or its Ray. The supervisor ends Ray
once the application has ended and no run is active: each run holds a `RunLock` for as
long as its drones may fly and its actors have work. `ray stop` would end all of the user's Rays,
so the supervisor ends its own child processes instead. On standard output it sends the application
one line of JSON per message: `{"address": ...}` or `{"error": ...}`, and `{"flying": true}` if it
has to stay after the application has closed its standard input.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fcntl
import json
import os
import select
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

__all__ = ["LOCKS", "PREFIX", "RAY", "VARIABLE", "RunLock", "main"]

VARIABLE = "AERODAAS_LOCAL_RAY"
"""Environment variable of all processes of a local Ray, set to its folder."""
PREFIX = "aerodaas-ray-"
LOCKS = "runs"
"""Folder of the locks of active runs."""
_RAYS_OWN = "ray"
"""Ray's folder, below our own because Ray opens it to all users of the machine."""
_OWN_LOCK = "supervisor.lock"
_START_SECONDS = 180.0
_LAST_LINES = 5
"""Of what Ray said before it ended. A Python that breaks has its reason some lines above."""
_GRACE_SECONDS = 3.0
"""Wait for actors that were told to end and still hold their locks."""
_DYING_SECONDS = 10.0
_SETTING_UP_SECONDS = 60.0
"""Age from which a folder without its supervisor's lock is one whose supervisor was killed."""
_LOOK_SECONDS = 0.2
_LONGEST = 40
"""Most characters of a temporary folder; a socket's path below it may have 107."""
_SUBREAPER = 36
RAY = """
import sys
from importlib.metadata import entry_points
sys.argv[0] = "ray"
(command,) = entry_points(group="console_scripts", name="ray")
sys.exit(command.load()())
"""
"""Program of the command `ray`, which a virtual environment may lack as a file."""


def main(application: int, streams: str, words: list[str]) -> None:
    """Run Ray, as `ray start` does.

    Args:
        application: Id of the application's process.
        streams: Folder of its streams' sockets; empty without.
        words: Arguments of `ray start`; one that ends with `=` gets the number of a free port.
    """
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    # Orphans of this Ray's processes become children of this process.
    ctypes.CDLL(None).prctl(_SUBREAPER, 1, 0, 0, 0)
    client = _Client(application)
    try:
        _supervise(client, streams, words)
    except Exception as error:
        client.send(error=f"{type(error).__name__}: {error}")
        raise


def _supervise(client: _Client, streams: str, words: list[str]) -> None:
    """Keep Ray in a folder of its own, and leave nothing of it."""
    base = Path(tempfile.gettempdir())
    base = base if len(str(base)) <= _LONGEST else Path("/tmp")  # noqa: S108 - mkdtemp follows
    _prune(base)
    folder = Path(tempfile.mkdtemp(prefix=PREFIX, dir=base))
    try:
        (folder / LOCKS).mkdir()
        with (folder / LOCKS / _OWN_LOCK).open("w") as own:
            fcntl.lockf(own, fcntl.LOCK_EX)
            # Renamed only when locked, so that no other supervisor finds it without an owner.
            Path(own.name).rename(folder / _OWN_LOCK)
            _keep(client, folder, words)
    finally:
        _end_all()
        _free_streams(streams)
        shutil.rmtree(folder, ignore_errors=True)


def _keep(client: _Client, folder: Path, words: list[str]) -> None:
    """Start Ray and return when it is to be ended."""
    address, reason = _start(client, folder, words)
    if not address:
        client.send(error=reason)
        return
    client.send(address=address, folder=str(folder))
    while not client.gone(1.0):
        _reap()
    until = time.monotonic() + _GRACE_SECONDS
    while _under_way(folder) and time.monotonic() < until:
        time.sleep(_LOOK_SECONDS)
    if _under_way(folder):
        client.send(flying=True)
    while _under_way(folder):
        _reap()
        time.sleep(_LOOK_SECONDS)


class _Client:
    """The application's process and the pipe to it."""

    def __init__(self, pid: int) -> None:
        try:
            self._process = os.pidfd_open(pid)
        except ProcessLookupError:
            sys.exit()  # it has already ended
        self._poll = select.poll()
        self._poll.register(self._process, select.POLLIN)
        self._poll.register(sys.stdin.fileno(), select.POLLIN | select.POLLHUP)

    def gone(self, timeout: float) -> bool:
        """Wait up to `timeout` seconds; return whether it has ended or closed the pipe."""
        return bool(self._poll.poll(timeout * 1000.0))

    def send(self, **words: object) -> None:
        """Send a message, ignored if the application has ended."""
        with contextlib.suppress(OSError):
            print(json.dumps(words), flush=True)  # noqa: T201 - this is the pipe


def _start(client: _Client, folder: Path, words: list[str]) -> tuple[str, str]:
    """Run `ray start`; returns Ray's address and "", or "" and the reason of the failure."""
    own = folder / _RAYS_OWN
    port, *others = _free_ports(1 + sum(word.endswith("=") for word in words))
    free = iter(others)
    words = [f"{word}{next(free)}" if word.endswith("=") else word for word in words]
    words.append(f"--port={port}")
    command = [sys.executable, "-c", RAY, "start", f"--temp-dir={own}", *words]
    with (folder / "start.log").open("w+") as log:
        starting = subprocess.Popen(  # noqa: S603 - fixed arguments
            command,
            env={**os.environ, VARIABLE: str(folder)},
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
        )
        until = time.monotonic() + _START_SECONDS
        while starting.poll() is None and time.monotonic() < until:
            if client.gone(_LOOK_SECONDS / 4):
                return "", "the application has gone"
        code = starting.poll()
        log.seek(0)
        said = log.read().strip()
    if code == 0:
        return f"127.0.0.1:{port}", ""
    if code is None:
        return "", f"`ray start` did not end within {_START_SECONDS:.0f} s"
    silent = f"`ray start` ended with code {code} and said nothing"
    return "", "\n".join(said.splitlines()[-_LAST_LINES:]) or silent


class RunLock:
    """Lock of an active run, held once constructed; without effect on a remote cluster.

    It is a POSIX record lock, which child processes do not inherit.
    """

    def __init__(self) -> None:
        folder = os.environ.get(VARIABLE)
        self._path = Path(folder) / LOCKS / uuid.uuid4().hex if folder else None
        if self._path is not None:
            self._file = self._path.open("w")
            fcntl.lockf(self._file, fcntl.LOCK_EX)

    def release(self) -> None:
        """Release the lock."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)
            self._file.close()
            self._path = None


def _free_ports(count: int) -> list[int]:
    """TCP ports of the loopback interface that nobody uses now."""
    with contextlib.ExitStack() as stack:
        made = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in made:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in made]


def _under_way(folder: Path) -> bool:
    """Whether a run still holds its lock."""
    return any(_held(path) for path in (folder / LOCKS).iterdir())


def _held(path: Path) -> bool:
    """Whether a living process holds the lock of this file."""
    try:
        with path.open("r+") as file:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except FileNotFoundError:
        return False
    return False


def _end_all() -> None:
    """Kill all descendants and wait for their end."""
    until = time.monotonic() + _DYING_SECONDS
    while (found := _descendants()) and time.monotonic() < until:
        for pid in found:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.02)
        _reap()


def _reap() -> None:
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def _descendants() -> list[int]:
    """All descendants of this process that have not ended."""
    parents = dict(_processes())
    ours = {os.getpid()}
    while more := {pid for pid, parent in parents.items() if parent in ours} - ours:
        ours |= more
    return sorted(ours - {os.getpid()})


def _processes() -> Iterator[tuple[int, int]]:
    """Id and parent id of each process of this machine that has not ended."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                # Of bytes, for a process's name may end within a letter.
                state, parent = (entry / "stat").read_bytes().rpartition(b")")[2].split()[:2]
                if state != b"Z":
                    yield int(entry.name), int(parent)


def _prune(base: Path) -> None:
    """Remove processes and folders of killed supervisors, unless a drone still flies."""
    for folder in base.glob(f"{PREFIX}*"):
        if _ours(folder) and _orphaned(folder):
            for pid, _ in list(_processes()):
                if _belongs(pid, folder):
                    with contextlib.suppress(OSError):
                        os.kill(pid, signal.SIGKILL)
            shutil.rmtree(folder, ignore_errors=True)


def _ours(folder: Path) -> bool:
    """Whether it is a folder made by this user, not a link or what another user has put there."""
    with contextlib.suppress(OSError):
        found = folder.lstat()
        return stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid()
    return False


def _orphaned(folder: Path) -> bool:
    """Whether neither its supervisor nor a run of it lives."""
    with contextlib.suppress(OSError):
        own = folder / _OWN_LOCK
        if not own.exists() and time.time() - folder.stat().st_mtime < _SETTING_UP_SECONDS:
            return False  # its supervisor may be about to lock it
        locks = folder / LOCKS
        return not _held(own) and not (locks.exists() and _under_way(folder))
    return False


def _belongs(pid: int, folder: Path) -> bool:
    with contextlib.suppress(OSError):
        return f"{VARIABLE}={folder}".encode() in Path(f"/proc/{pid}/environ").read_bytes().split(
            b"\0"
        )
    return False


def _free_streams(folder: str) -> None:
    """Remove the sockets of streams that processes which were killed have left, and their folders.

    `actors/streams/rendezvous.py` says what is there.
    """
    top = Path(folder) if folder else Path(os.devnull)
    for path in [*top.glob("*/*"), *top.glob("*/*/*")]:
        with contextlib.suppress(OSError):
            if not path.exists() or (path.is_socket() and _is_deserted(path)):
                path.unlink()
    for path in [*top.glob("*/*"), *top.glob("*")]:
        with contextlib.suppress(OSError):
            path.rmdir()


def _is_deserted(path: Path) -> bool:
    """Whether no process has this socket. One that is new may be about to listen to it."""
    if time.time() - path.stat().st_mtime < _SETTING_UP_SECONDS and path.suffix == ".new":
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK) as caller:
        return caller.connect_ex(str(path)) == errno.ECONNREFUSED


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], sys.argv[3:])
