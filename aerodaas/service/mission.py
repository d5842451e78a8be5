"""One mission on its way: rehearsed, queued for its lease, flown, over."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.link import FlightLink
from aerodaas.service.flights.order import FlightOrder, Outcome
from aerodaas.service.flights.starter import start_process
from aerodaas.service.phases import FOLLOWING, OVER
from aerodaas.protocol.schemas import MissionPhase, VerdictOut
from aerodaas.service.store import MissionRow

__all__ = ["CANCELLED_BY", "ActiveMission", "LostFlightError"]

CANCELLED_BY = "cancelled by "
"""How the reason of a cancelled mission begins."""
_LAST_WORDS = 300
"""Characters of a dead process' log that are told."""


class LostFlightError(Exception):
    """A flight's process has died in flight: nobody here knows where its drones are."""


class ActiveMission:
    """A mission that is not over, with its folders and processes; for one thread at a time."""

    def __init__(self, row: MissionRow, path: Path, save: Callable[[MissionRow], None]) -> None:
        """Take up a mission.

        Args:
            row: Its row in the database.
            path: Its folder.
            save: Writes a changed row.
        """
        self.row = row
        self.flight = FlightFolder(path / "f")
        self.rehearsal = FlightFolder(path / "r")
        self.link: FlightLink | None = None
        self.version = 0
        """Counts the changes."""
        self._save = save
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def phase(self) -> MissionPhase:
        """Its phase."""
        return self.row.phase

    @property
    def over(self) -> bool:
        """Whether nothing follows any more."""
        return self.phase in OVER

    def to(self, phase: MissionPhase, reason: str = "", **changes: object) -> None:
        """Change the phase; the database is written first."""
        assert phase in FOLLOWING[self.phase], (self.phase, phase)  # noqa: S101 - our own order
        row = replace(self.row, phase=phase, reason=reason, **changes)
        self._save(row)
        self.row = row
        self.version += 1

    def rehearse(self, order: FlightOrder, document: MissionDocument) -> None:
        """Start the rehearsal; one that a former service began is begun again."""
        self.end_rehearsal()
        shutil.rmtree(self.rehearsal.path, ignore_errors=True)
        self.rehearsal.make(order, document.text())

    def start_rehearsal(self) -> None:
        """Start the rehearsal's process."""
        self._process = start_process(self.rehearsal)

    def verdict(self) -> VerdictOut | None:
        """The rehearsal's verdict; None while it goes on."""
        if self._process is not None and self._process.poll() is None:
            return None
        if self._process is None and self.rehearsal.flying:
            return None
        outcome = self.rehearsal.outcome()
        if outcome is not None and outcome.verdict is not None:
            return outcome.verdict
        return VerdictOut(approved=False, reasons=[f"the rehearsal failed: {self._last_words()}"])

    def end_rehearsal(self) -> None:
        """End the rehearsal's process, and all that it has started."""
        process, self._process = self._process, None
        if process is not None and process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()

    def take_off(self, order: FlightOrder, document: MissionDocument) -> None:
        """Start the flight's process, unless it has been started before."""
        if self.flight.begun:
            return
        self.flight.make(order, document.text())

    def start_flight(self) -> None:
        """Start the process of the flight whose order has been written."""
        if not self.flight.begun:
            self._process = start_process(self.flight)

    def follow(self) -> FlightLink:
        """The link to the flight, made when it is first needed."""
        if self.link is None:
            self.link = FlightLink(self.flight, self._told)
        return self.link

    def flown(self) -> Outcome | None:
        """How the flight ended; None while it goes on.

        Raises LostFlightError if its process died in flight.
        """
        if self.flight.flying or (self._process is not None and self._process.poll() is None):
            return None
        outcome = self.flight.outcome()
        if outcome is None and self.flight.begun:
            raise LostFlightError(self._last_words())
        if outcome is None:
            text = f"the flight did not begin: {self._last_words()}"
            return Outcome(landed=False, reason=text, began=0.0, ended=0.0)
        return outcome

    def close(self) -> None:
        """Leave the mission to itself: a flight goes on."""
        self.end_rehearsal()
        if self.link is not None:
            self.link.close()

    def _told(self) -> None:
        self.version += 1

    def _last_words(self) -> str:
        folder = self.flight if self.phase is MissionPhase.FLYING else self.rehearsal
        try:
            lines = folder.log.read_text(errors="replace").strip().splitlines()
        except OSError:
            lines = []
        return lines[-1][-_LAST_WORDS:] if lines else "its process ended without a word"
