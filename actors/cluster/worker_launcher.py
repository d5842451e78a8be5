"""Program that Ray starts for each worker: has the fork server make it, or starts Python anew.

It is run as a script and needs the standard library only. Ray's own way imports Ray twice and then
what an actor needs, more than a second of a core; a fork of a process that has imported all of it
(`fork_server.py`) takes a tenth of that, and shares its memory. What a fork cannot give goes Ray's
own way: another interpreter, a container, or variables of the worker's own, which libraries may
read as they are loaded.
"""

from __future__ import annotations

import array
import json
import os
import socket
import sys
from pathlib import Path

__all__ = ["main"]

_SECONDS = 30.0
"""Longest wait for the fork server, which may be importing still."""
_CONTEXT, _LANGUAGE = "--serialized-runtime-env-context=", "--language="


def main(words: list[str]) -> None:
    """Start the worker that Ray's `words` describe: its program, and the arguments."""
    if not _is_plain(words) or not _forked(words):
        program = next(word for word in words if not word.startswith("-"))
        setup = str(Path(program).with_name("setup_worker.py"))
        os.execv(sys.executable, [sys.executable, setup, *words])  # noqa: S606 - Ray's own program


def _is_plain(words: list[str]) -> bool:
    """Whether it runs this Python with the variables that all workers have."""
    context: dict[str, object] = {}
    language = ""
    for word in words:
        if word.startswith(_CONTEXT):
            context = json.loads(word.removeprefix(_CONTEXT) or "{}")
        elif word.startswith(_LANGUAGE):
            language = word.removeprefix(_LANGUAGE)
    same = context.pop("py_executable", None) in {None, sys.executable}
    # Flags of the interpreter's own come before Ray's program.
    return language == "PYTHON" and same and not any(context.values()) and words[0][0] != "-"


def _forked(words: list[str]) -> bool:
    """Whether the fork server has made the worker, with this process' variables and output."""
    rest = [word for word in words if not word.startswith((_CONTEXT, _LANGUAGE))]
    wanted = {"words": rest, "variables": dict(os.environ), "folder": str(Path.cwd())}
    outputs = array.array("i", [1, 2])
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as server:
        server.settimeout(_SECONDS)
        try:
            server.connect(os.environ["AERODAAS_FORK_SERVER"])
            rights = (socket.SOL_SOCKET, socket.SCM_RIGHTS, outputs)
            server.sendmsg([json.dumps(wanted).encode()], [rights])
            return server.recv(1) == b"1"
        except (KeyError, OSError):
            return False


if __name__ == "__main__":
    main(sys.argv[1:])
