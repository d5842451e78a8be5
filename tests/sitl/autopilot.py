"""The autopilots that the environment names, and the processes that they are."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["Autopilot", "autopilot"]


class Autopilot:
    """One autopilot in simulation; `command` starts it, if the environment says how."""

    def __init__(self, family: str, url: str, command: str = "") -> None:
        self.family = family
        self.url = url
        self._command = command
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def restarts(self) -> bool:
        """Whether we start it ourselves, and so can start it anew."""
        return bool(self._command)

    def start(self) -> None:
        """Switch it on."""
        if self._command:
            self._process = subprocess.Popen(
                shlex.split(self._command),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )

    def stop(self) -> None:
        """Switch it off, as a loss of power would."""
        if self._process is not None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
            self._process = None


@contextmanager
def autopilot(family: str, named: str, boot: float) -> Iterator[Autopilot]:
    """The autopilot that the variable names, started `boot` seconds ago if it says how."""
    command, _, url = named.rpartition("=>")
    vehicle = Autopilot(family, url.strip(), command.strip())
    vehicle.start()
    try:
        if vehicle.restarts:
            time.sleep(boot)
        yield vehicle
    finally:
        vehicle.stop()
