"""Folders of dead local Rays are removed: only ours, and none that a living process uses."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from required import needs_root

from aerodaas.actors.cluster import ray_process
from aerodaas.actors.cluster.ray_process import LOCKS, PREFIX

_HOLD = """
import fcntl, sys, time
file = open(sys.argv[1], "w")
fcntl.lockf(file, fcntl.LOCK_EX)
print("held", flush=True)
time.sleep(60)
"""


def session(base: Path, name: str, *, lock: bool = True, age: float = 3600.0) -> Path:
    """A folder as a supervisor leaves one that is killed."""
    folder = base / f"{PREFIX}{name}"
    (folder / LOCKS).mkdir(parents=True)
    (folder / "ray" / "session_old" / "logs").mkdir(parents=True)
    if lock:
        (folder / "supervisor.lock").touch()
    then = time.time() - age
    os.utime(folder, (then, then))
    return folder


@contextmanager
def held(path: Path) -> Iterator[None]:
    """A living process holds the lock of this file."""
    with subprocess.Popen([sys.executable, "-c", _HOLD, path], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield
        process.kill()


def test_what_the_dead_left_goes(tmp_path: Path) -> None:
    """Also if the supervisor was killed before it had its lock."""
    left = [session(tmp_path, "one"), session(tmp_path, "two", lock=False)]
    other = tmp_path / "session_of_somebody_else"
    other.mkdir()
    ray_process._prune(tmp_path)
    assert not any(folder.exists() for folder in left)
    assert other.exists()


def test_what_a_living_process_uses_stays(tmp_path: Path) -> None:
    """Its supervisor, or a run whose drone may fly."""
    supervised, flying = session(tmp_path, "one"), session(tmp_path, "two")
    bare = session(tmp_path, "three", lock=False)
    begun = session(tmp_path, "four", lock=False, age=1.0)
    with (
        held(supervised / "supervisor.lock"),
        held(flying / LOCKS / "run"),
        held(bare / LOCKS / "supervisor.lock"),
    ):
        ray_process._prune(tmp_path)
        assert all(folder.exists() for folder in (supervised, flying, bare, begun))
    ray_process._prune(tmp_path)
    assert not any(folder.exists() for folder in (supervised, flying, bare))
    assert begun.exists()


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    """It may lead to what is somebody's own."""
    (tmp_path / "base").mkdir()
    real = session(tmp_path, "real")
    (tmp_path / "base" / f"{PREFIX}link").symlink_to(real)
    ray_process._prune(tmp_path / "base")
    assert (real / "ray" / "session_old").exists()


@needs_root
def test_another_users_stays(tmp_path: Path) -> None:
    """Even if we have the rights to remove it."""
    theirs = session(tmp_path, "theirs")
    os.chown(theirs, 65534, 65534)
    ray_process._prune(tmp_path)
    assert theirs.exists()


def test_a_name_that_ends_within_a_letter_stops_nobody() -> None:
    """The kernel keeps 15 bytes of a process' name, whoever's process it is."""
    code = "import ctypes; ctypes.CDLL(None).prctl(15, 'Landvermessungü'.encode(), 0, 0, 0)"
    words = [sys.executable, "-c", f"{code}; print('named', flush=True); input()"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        assert b"\xc3)" in Path(f"/proc/{process.pid}/stat").read_bytes()
        assert (process.pid, os.getpid()) in list(ray_process._processes())
        assert process.pid in ray_process._descendants()
