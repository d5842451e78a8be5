"""Fork server of a local Ray: has imported what actors need, and is forked for each worker.

As Python's own `multiprocessing.forkserver`, its processes run no thread and keep nothing but
modules, so that a fork of one is as good as a new process. Ray reads its variables as it is loaded,
and the workers of a job differ from those of no job in one: for each set of them the server has
itself forked once, as a template, which loads Ray and is forked for each worker. They end with the
supervisor that started the server (`ray_process.py`); workers live on until Ray ends them.
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

from aerodaas.actors.process_variables import AT_START

__all__ = ["main"]

_EARLY = ("aerodaas.mission.loop", "aerodaas.drivers.simulated", "aerodaas.recording.recorder")
"""Modules of the server, imported while Ray starts. None imports Ray or starts a thread."""
_LATE = ("ray._private.workers.default_worker", "aerodaas.actors.run.flight")
"""Further modules of a template."""
_MOST_TEMPLATES = 4
_READ_LATER = {"PYTHONBREAKPOINT", "PYTHONUNBUFFERED", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"}
"""Variables of those read at a process' start that make no difference to a worker here."""
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
    files: list[int]
    """Standard output and error; in a template, then the socket of who asks."""
    text: bytes
    """All of it but the files, as it was sent."""


class _Server:
    """The templates, by the variables that they have been loaded with."""

    def __init__(self) -> None:
        self._began_with = _chosen(os.environ, AT_START)
        self._templates: dict[frozenset[tuple[str, str]], socket.socket] = {}
        for name in _EARLY:
            importlib.import_module(name)

    def serve(self, caller: socket.socket) -> socket.socket | None:
        """Pass on to a template what is asked for, or refuse it.

        Returns where a template gets its work, in one just forked; None in the server.
        Raises OSError, ValueError or KeyError if nothing of the kind is asked for.
        """
        caller.settimeout(_LOOK_SECONDS)
        wanted = _received(caller, 2)
        try:
            key = frozenset(_chosen(wanted.variables, ("RAY_",)).items())
            alike = _chosen(wanted.variables, AT_START) == self._began_with
            if alike and key not in self._templates and len(self._templates) < _MOST_TEMPLATES:
                ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                if os.fork() == 0:
                    for one in (ours, *self._templates.values()):
                        one.close()
                    return theirs
                theirs.close()
                self._templates[key] = ours
            if not alike or key not in self._templates:
                caller.send(_REFUSED)
            elif not _sent(self._templates[key], wanted, caller):
                self._templates.pop(key).close()  # it has been killed; the next gets another
        finally:
            for file in wanted.files:
                os.close(file)
        return None


def main(path: str) -> None:
    """Serve at the socket `path` until the parent has ended; in a worker, until its own end."""
    parent = os.getppid()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    work = None
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(path)
        listener.listen(64)  # who asks before the modules are there waits
        listener.settimeout(_LOOK_SECONDS)
        server = _Server()
        while work is None and os.getppid() == parent:
            with contextlib.suppress(TimeoutError):
                caller, _ = listener.accept()
                with caller, contextlib.suppress(OSError, ValueError, KeyError):
                    work = server.serve(caller)
    wanted = _template(work) if work is not None else None
    if wanted is not None:
        _become(wanted)


def _template(work: socket.socket) -> _Wanted | None:
    """Load Ray and fork for each worker asked for; returns it there, None when the server ends."""
    loaded = False
    with contextlib.suppress(OSError, ValueError), work:
        while True:
            wanted = _received(work, 3)
            if not loaded:
                os.environ.update(wanted.variables)
                for name in _LATE:
                    importlib.import_module(name)
                gc.collect()
                gc.freeze()  # or each worker's first collection would copy all that it shares
                loaded = True
            # A fork has none of the other threads, and what they hold is held for ever.
            alone = len(list(Path("/proc/self/task").iterdir())) == 1
            if alone and os.fork() == 0:
                os.close(wanted.files.pop())
                return wanted
            with socket.socket(fileno=wanted.files.pop()) as caller, contextlib.suppress(OSError):
                caller.send(_DONE if alone else _REFUSED)
            for file in wanted.files:
                os.close(file)
    return None


def _sent(template: socket.socket, wanted: _Wanted, caller: socket.socket) -> bool:
    """Whether a template has got it."""
    files = array.array("i", [*wanted.files, caller.fileno()])
    with contextlib.suppress(OSError):
        template.sendmsg([wanted.text], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, files)])
        return True
    return False


def _received(asking: socket.socket, files: int) -> _Wanted:
    """What is asked for with so many files; raises ValueError if nothing comes any more."""
    room = socket.CMSG_SPACE(array.array("i").itemsize * files)
    text, rights, _, _ = asking.recvmsg(_MOST_BYTES, room)
    ((_, _, sent),) = rights
    told: dict[str, Any] = json.loads(text)
    found = array.array("i", sent).tolist()
    return _Wanted(told["words"], told["variables"], told["folder"], found, text)


def _become(wanted: _Wanted) -> None:
    """Be the worker: run Ray's program as a new process would."""
    os.setpgid(0, 0)  # Ray ends the group of a worker that has died
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    for number, file in enumerate(wanted.files, start=1):
        os.dup2(file, number)
        os.close(file)
    os.environ.clear()
    os.environ.update(wanted.variables)
    os.chdir(wanted.folder)
    program = wanted.words[0]
    sys.argv[:] = wanted.words
    sys.path.insert(0, str(Path(program).parent))
    # Python's own generator is seeded anew by itself; numpy's would give all workers the same.
    np.random.seed()  # noqa: NPY002 - users may draw from it
    runpy.run_path(program, run_name="__main__")


def _chosen(variables: Mapping[str, str], prefixes: tuple[str, ...]) -> dict[str, str]:
    """Variables in which a worker must not differ from the process that it is forked from."""
    return {
        name: value
        for name, value in variables.items()
        if name.startswith(prefixes) and name not in _READ_LATER
    }


if __name__ == "__main__":
    with contextlib.suppress(ValueError):
        sys.path.remove(str(Path(__file__).parent))  # its modules have no names of their own
    main(sys.argv[1])
