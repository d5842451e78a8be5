"""Fork server of a local Ray: has imported what actors need, and forks itself for each worker.

As Python's own `multiprocessing.forkserver`, it runs no thread and keeps nothing but modules, so
that a fork of it is as good as a new process. It ends with the supervisor that started it
(`ray_process.py`); its workers live on until Ray ends them.
"""

from __future__ import annotations

import array
import contextlib
import gc
import importlib
import json
import os
import runpy
import signal
import socket
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerodaas.actors.cluster.ray_internals import reread_variables, rereads_variables

__all__ = ["main"]

_MODULES = (
    "ray._private.workers.default_worker",
    "aerodaas.actors.run.actor_classes",
    "aerodaas.drivers.simulated",
    "aerodaas.recording.recorder",
)
"""What each worker imports first. None starts a thread, but numpy's BLAS where it may."""
_READ_AT_ONCE = ("LD_", "PYTHON", "GLIBC_", "MALLOC_", "OMP_", "OPENBLAS_", "MKL_")
"""Prefixes of variables that are read as a process, or a library, is loaded."""
_READ_LATER = {"PYTHONBREAKPOINT", "PYTHONUNBUFFERED", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"}
"""Those of them that make no difference to a worker here."""
_DONE, _REFUSED = b"1", b"0"
_LOOK_SECONDS = 5.0
_MOST_BYTES = 2**20


@dataclass(frozen=True)
class _Wanted:
    """A worker to become, as its launcher has asked for it."""

    words: list[str]
    """Ray's program for workers, and its arguments."""
    variables: dict[str, str]
    folder: str
    outputs: list[int]
    """Files for its standard output and error."""


def main(path: str) -> None:
    """Serve at the socket `path` until the parent has ended; in a worker, until its own end."""
    parent, began_with = os.getppid(), _read_at_once(os.environ)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    wanted = None
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(path)
        listener.listen(64)  # who asks before all is imported waits
        for name in _MODULES:
            importlib.import_module(name)
        # A fork has none of the other threads, and what they hold is held for ever.
        if len(list(Path("/proc/self/task").iterdir())) > 1 or not rereads_variables():
            return  # workers start Ray's own way
        gc.collect()
        gc.freeze()  # or each worker's first collection would copy all that it shares
        listener.settimeout(_LOOK_SECONDS)
        while wanted is None and os.getppid() == parent:
            with contextlib.suppress(TimeoutError):
                caller, _ = listener.accept()
                with caller, contextlib.suppress(OSError, ValueError, KeyError):
                    wanted = _serve(caller, began_with)
    if wanted is not None:
        _become(wanted)


def _serve(caller: socket.socket, began_with: dict[str, str]) -> _Wanted | None:
    """Fork for who asks; returns what to become in the worker, None in the server.

    A worker that does not begin with the same variables as the server did is refused.
    Raises OSError, ValueError or KeyError if nothing of the kind is asked for.
    """
    caller.settimeout(_LOOK_SECONDS)
    wanted = _received(caller)
    same = _read_at_once(wanted.variables) == began_with
    if same and os.fork() == 0:
        return wanted
    for file in wanted.outputs:
        os.close(file)
    caller.send(_DONE if same else _REFUSED)
    return None


def _received(caller: socket.socket) -> _Wanted:
    room = socket.CMSG_SPACE(array.array("i").itemsize * 2)
    text, rights, _, _ = caller.recvmsg(_MOST_BYTES, room)
    ((_, _, sent),) = rights
    told: dict[str, Any] = json.loads(text)
    outputs = array.array("i", sent).tolist()
    return _Wanted(told["words"], told["variables"], told["folder"], outputs)


def _become(wanted: _Wanted) -> None:
    """Be the worker: run Ray's program as a new process would."""
    os.setpgid(0, 0)  # Ray ends the group of a worker that has died
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    for number, file in enumerate(wanted.outputs, start=1):
        os.dup2(file, number)
        os.close(file)
    os.environ.clear()
    os.environ.update(wanted.variables)
    reread_variables()  # which Ray read as it was loaded: its job, the process of its node
    os.chdir(wanted.folder)
    program = wanted.words[0]
    sys.argv[:] = wanted.words
    sys.path.insert(0, str(Path(program).parent))
    # Python's own generator is seeded anew by itself; numpy's would give all workers the same.
    np.random.seed()  # noqa: NPY002 - users may draw from it
    runpy.run_path(program, run_name="__main__")


def _read_at_once(variables: Mapping[str, str]) -> dict[str, str]:
    """Variables in which a worker must not differ from the process that it is forked from."""
    return {
        name: value
        for name, value in variables.items()
        if name.startswith(_READ_AT_ONCE) and name not in _READ_LATER
    }


if __name__ == "__main__":
    with contextlib.suppress(ValueError):
        sys.path.remove(str(Path(__file__).parent))  # its modules have no names of their own
    main(sys.argv[1])
