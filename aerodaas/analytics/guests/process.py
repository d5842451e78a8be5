"""A guest's process, as its owner starts, asks and ends it."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

from aerodaas.analytics.guests.channel import Channel, GuestError

__all__ = ["GuestProcess"]

_KEPT = ("PATH", "LANG", "LC_ALL", "LC_CTYPE", "TZ")
"""Variables of the owner's environment that a guest is given."""
_ROOT = Path(__file__).resolve().parents[3]
_START_SECONDS = 60.0
_SERVED_BY = "aerodaas.environment.guest_process"
_SAID = 300
"""Most characters of a guest's words in an error."""


class GuestProcess:
    """A process in a session of its own, with limits, that runs the code of one guest.

    It has no Ray, no secret in its environment, and a folder of its own, removed at its end.
    """

    def __init__(self, guest: str, memory: int, cpu: int = 0, folder: Path | None = None) -> None:
        """Start the process of `guest`.

        Args:
            guest: Name of the guest.
            memory: Most megabytes of private memory.
            cpu: Most seconds of processor time; 0 for no limit.
            folder: Working folder instead of its own.

        Raises:
            GuestError: If it does not start.
        """
        self.guest = guest
        self._home = Path(tempfile.mkdtemp(prefix=f"aerodaas-guest-{guest}-"))
        self._lock = threading.Lock()
        self._fate = ""
        self.told = False
        """Whether its end has been told."""
        ours, theirs = socket.socketpair()
        self._channel = Channel(ours)
        number = theirs.fileno()
        code = f"import sys; sys.path.append({str(_ROOT)!r}); import runpy; "
        code += "runpy.run_module('aerodaas.analytics.guests.sandbox', run_name='__main__')"
        words = [str(number), str(memory), str(cpu), _SERVED_BY]
        command = [sys.executable, "-I", "-c", code, *words]
        self._outer: subprocess.Popen[bytes] | None = None
        started = threading.Event()
        ended = threading.Event()
        self._ended = ended

        def keep() -> None:
            # The signal of a parent's death comes at the end of the thread that has started it.
            with theirs, contextlib.ExitStack() as done:
                done.callback(started.set)
                self._outer = subprocess.Popen(  # noqa: S603 - our own code
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=2,
                    env=self._environment(),
                    cwd=folder or self._home,
                    pass_fds=(number,),
                    start_new_session=True,
                )
            self._outer.wait()
            ended.set()

        threading.Thread(target=keep, name=f"guest {guest}", daemon=True).start()
        started.wait(_START_SECONDS)
        try:
            told, _ = self._channel.receive(_START_SECONDS)
            self.pid = int(told["process"])
            self.isolated = bool(told["isolated"])
        except GuestError:
            self.end()
            raise

    def _environment(self) -> dict[str, str]:
        kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
        own = {"HOME": str(self._home), "TMPDIR": str(self._home), "OMP_NUM_THREADS": "1"}
        return {**kept, **own, "PYTHONDONTWRITEBYTECODE": "1"}

    @property
    def fate(self) -> str:
        """Reason for its end; empty while it runs."""
        return self._fate

    def ask(
        self, text: dict[str, Any], blob: bytes = b"", timeout: float = 5.0
    ) -> tuple[dict[str, Any], bytes]:
        """Send a message and return the answer; a guest that fails to answer is ended.

        Raises GuestError with the reason.
        """
        with self._lock:
            if self._fate:
                raise GuestError(self._fate)
            try:
                self._channel.send(text, blob, timeout)
                return self._channel.receive(timeout)
            except GuestError as error:
                self.end(f"{error}{self._exit_text()}"[:_SAID])
                raise GuestError(self._fate) from None

    def end(self, reason: str = "it was ended") -> None:
        """End all its processes and remove its folder."""
        self._fate = self._fate or reason
        if hasattr(self, "pid") and not self._ended.is_set():
            with contextlib.suppress(OSError):
                os.kill(self.pid, signal.SIGKILL)
            # The process outside ends when all inside have ended.
            self._ended.wait(2.0)
        if self._outer is not None:
            with contextlib.suppress(OSError):
                os.killpg(self._outer.pid, signal.SIGKILL)
            self._ended.wait(5.0)
        self._channel.close()
        shutil.rmtree(self._home, ignore_errors=True)

    def _exit_text(self) -> str:
        """How it ended by itself; empty if it still runs."""
        if self._outer is None or not self._ended.wait(0.5):
            return ""
        return f", with code {self._outer.returncode}"
