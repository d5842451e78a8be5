"""One simulator from its start to its end."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import time
from pathlib import Path
from types import TracebackType

from typing_extensions import Self

from aerodaas.errors import SourceError
from aerodaas.extensions.sitl.programs import PROGRAMS, Family, SitlOptions

__all__ = ["SitlProcess"]

_MAGIC = (0xFD, 0xFE)
"""First byte of a MAVLink packet."""
_LOOK = 0.1
"""Seconds between two looks."""
_ENDING = 5.0
"""Seconds from SIGTERM to SIGKILL."""
_LAST_LINES = 5
"""Lines of a dead simulator's output that are told."""
_PACKET = 2048


class SitlProcess:
    """A simulator that flies for as long as the `with` lasts."""

    def __init__(self, family: Family, options: SitlOptions, timeout: float = 30.0) -> None:
        """Find the program; raises SourceError if there is none.

        `timeout` in seconds is what it gets until its vehicle is heard.
        """
        self.program = PROGRAMS[family](options)
        self.log: Path = options.state / "simulator.log"
        """What it prints."""
        self.url = "udpin:{}:{}".format(*options.heard_at)
        """Of the vehicle, for the setting `url` of the driver `mavlink`."""
        self.system = options.system
        """Its system id, if one was asked for."""
        self._options = options
        self._timeout = timeout
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        """Start it, and wait until its vehicle is heard.

        Raises SourceError if its port is taken, if it dies, or says nothing in time.
        """
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as heard:
            try:
                heard.bind(self._options.heard_at)
            except OSError as error:
                raise SourceError(
                    f"port {self._options.heard_at[1]} is taken ({error.strerror}): end what flies "
                    "there, or give another --instance"
                ) from None
            heard.settimeout(_LOOK)
            self._options.state.mkdir(parents=True, exist_ok=True)
            with self.log.open("ab") as log:
                self._process = subprocess.Popen(  # noqa: S603 - what the user has installed
                    self.program.command,
                    cwd=self._options.state,
                    env={**os.environ, **self.program.environment},
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
            try:
                self._await_word(heard)
            except BaseException:
                self.stop()
                raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def _await_word(self, heard: socket.socket) -> None:
        deadline = time.monotonic() + self._timeout
        while time.monotonic() < deadline:
            self.require_alive()
            with contextlib.suppress(TimeoutError):
                packet = heard.recv(_PACKET)
                if packet and packet[0] in _MAGIC:
                    return
        raise SourceError(
            f"{self.program.command[0]} said nothing at {self.url} within {self._timeout:g} s"
            f"{self._said()}"
        )

    def require_alive(self) -> None:
        """Raise SourceError, with its last words, if it has ended."""
        code = None if self._process is None else self._process.poll()
        if code is not None:
            ended = f"by signal {-code}" if code < 0 else f"with code {code}"
            raise SourceError(f"{self.program.command[0]} has ended {ended}{self._said()}")

    def wait(self) -> None:
        """Return never; raises SourceError when it ends by itself."""
        while True:
            self.require_alive()
            time.sleep(_LOOK)

    def _said(self) -> str:
        lines = self.log.read_text(errors="replace").splitlines() if self.log.is_file() else []
        last = "".join(f"\n  {line}" for line in lines[-_LAST_LINES:])
        return f"; its last words, of {self.log}:{last}" if last else "; it printed nothing"

    def stop(self) -> None:
        """End it, and what it has started, by their own session; nothing else is touched."""
        process, self._process = self._process, None
        if process is None:
            return
        for number in (signal.SIGTERM, signal.SIGKILL):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_ENDING)
