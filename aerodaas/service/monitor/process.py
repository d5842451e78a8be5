"""The monitor as the service starts, asks and restarts it."""

from __future__ import annotations

import contextlib
import logging
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from pydantic import ValidationError

from aerodaas.service.flights.folder import service_free_environment
from aerodaas.service.monitor.reports import MonitorReport, MonitorRequest, WatchedVehicle

__all__ = ["FleetMonitor"]

_log = logging.getLogger(__name__)

_STUCK_SECONDS = 10.0
"""Seconds within which the monitor lets go of a vehicle, or is ended, which lets go of all."""
_AGAIN_SECONDS = 2.0
"""Seconds between two starts."""


class FleetMonitor:
    """The monitor's process, started anew when it ends; safe in any thread.

    A process of its own, for drivers may be the provider's own code, or hang; and because its end,
    of whatever kind, lets go of every vehicle.
    """

    def __init__(
        self, fleet: Path, log: Path, told: Callable[[Mapping[str, WatchedVehicle]], None]
    ) -> None:
        """Watch the vehicles of the environment file `fleet`; `told` is called with all report."""
        self._command = [sys.executable, "-m", "aerodaas.service.monitor", str(fleet)]
        self._log = log
        self._told = told
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._started_at = -_AGAIN_SECONDS
        self._number = 0
        self._wanted: frozenset[str] = frozenset()
        self._let_go_at: dict[str, float] = {}
        """Since when each vehicle is to be let go of, by `time.monotonic`."""
        self._report = MonitorReport(number=0)
        self._closed = False

    def hold(self, robots: Collection[str]) -> None:
        """Hold these vehicles from now on and let go of all others; call it every second or so."""
        now = time.monotonic()
        with self._lock:
            if self._closed:
                return
            wanted = frozenset(robots)
            if wanted != self._wanted:
                gone = self._wanted - wanted
                self._let_go_at = {**self._let_go_at, **dict.fromkeys(gone, now)}
                self._wanted = wanted
                self._number += 1
                self._send()
            self._let_go_at = {
                name: since
                for name, since in self._let_go_at.items()
                if name not in wanted and not self._released(name)
            }
            if any(now - since > _STUCK_SECONDS for since in self._let_go_at.values()):
                _log.warning("the monitor does not let go of %s: ended", ", ".join(self._let_go_at))
                self._end()
            if (self._process is None or self._process.poll() is not None) and (
                now - self._started_at >= _AGAIN_SECONDS
            ):
                self._start(now)

    def released(self, robots: Collection[str]) -> bool:
        """Whether the monitor holds none of these, and will not before it is told to."""
        with self._lock:
            return all(map(self._released, robots))

    def close(self) -> None:
        """End the process, which lets go of all vehicles."""
        with self._lock:
            self._closed = True
            self._end()

    def _released(self, robot: str) -> bool:
        if robot in self._wanted:
            return False
        if self._process is None or self._process.poll() is not None:
            return True
        obeyed = self._report.number == self._number
        return obeyed and not self._report.robots.get(robot, WatchedVehicle()).held

    def _start(self, now: float) -> None:
        self._started_at = now
        self._report = MonitorReport(number=-1)
        with self._log.open("ab") as log:
            process = self._process = subprocess.Popen(  # noqa: S603 - our own module
                self._command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                start_new_session=True,
                env=service_free_environment(vehicles=True),
            )
        self._send()
        threading.Thread(target=self._read, args=(process,), name="monitor", daemon=True).start()

    def _send(self) -> None:
        line = MonitorRequest(number=self._number, robots=self._wanted).model_dump_json()
        if self._process is not None and self._process.stdin is not None:
            # One that has died is started anew, and told then.
            with contextlib.suppress(OSError):
                self._process.stdin.write(f"{line}\n".encode())
                self._process.stdin.flush()

    def _end(self) -> None:
        process = self._process
        if process is not None:
            process.kill()
            process.wait()
            self._let_go_at.clear()

    def _read(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None  # noqa: S101 - asked for a pipe
        with process.stdout as lines:
            for line in lines:
                try:
                    report = MonitorReport.model_validate_json(line)
                except ValidationError:
                    continue
                with self._lock:
                    if process is not self._process:
                        return
                    self._report = report
                self._told(report.robots)
        self._told({})
