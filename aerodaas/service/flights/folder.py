"""Folder of one flight: its files, its lock, and the mark that it has begun."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from aerodaas.config.file_lock import exclusive, is_locked
from aerodaas.config.private_file import write_private
from aerodaas.errors import MissionError
from aerodaas.service.flights.order import FlightOrder, Outcome, Progress

__all__ = ["FlightFolder"]


class FlightFolder:
    """One flight's folder; its content is the truth of a flight, whatever a database says."""

    def __init__(self, path: Path) -> None:
        """Name a folder, which need not exist."""
        self.path = path.absolute()
        self.order = self.path / "order.json"
        self.document = self.path / "mission.json"
        self.models = self.path / "models"
        self.recording = self.path / "flight.mcap"
        self.picture = self.path / "rehearsal.png"
        self.log = self.path / "log"
        self.socket = self.path / "api"
        """Unix socket at which the flight's process serves the API."""
        self._begun = self.path / "begun"
        self._lock = self.path / "lock"
        self._cancelled = self.path / "cancelled"
        self._progress = self.path / "progress.json"
        self._outcome = self.path / "outcome.json"

    def make(self, order: FlightOrder, document: str) -> None:
        """Create the folder with an order and the text of a document, for this user alone."""
        self.models.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_private(self.document, document)
        write_private(self.order, order.model_dump_json(indent=2))

    @property
    def begun(self) -> bool:
        """Whether a process has ever begun this flight."""
        return self._begun.exists()

    @contextlib.contextmanager
    def claim(self) -> Iterator[None]:
        """Begin the flight, once and for all; hold its lock until the flight is over.

        Raises MissionError if it has been begun before, by this or any other process.
        """
        text = f"the flight in {self.path} has been begun before"
        # The lock first: a flight that has begun and holds no lock was killed.
        with exclusive(self._lock, text):
            try:
                self._begun.touch(exist_ok=False, mode=0o600)
            except FileExistsError:
                raise MissionError(text) from None
            yield

    @property
    def flying(self) -> bool:
        """Whether a living process holds the flight's lock; a killed one holds none."""
        return is_locked(self._lock)

    def cancel(self, reason: str) -> None:
        """Keep a cancellation for the flight's process, which may not listen yet."""
        write_private(self._cancelled, reason)

    @property
    def cancelled(self) -> str:
        """Why the flight is cancelled; empty if it is not."""
        try:
            return self._cancelled.read_text(encoding="utf-8")
        except OSError:
            return ""

    def advance(self, progress: Progress) -> None:
        """Write how far the rehearsal has come."""
        write_private(self._progress, progress.model_dump_json())

    def progress(self) -> Progress:
        """How far the rehearsal has come."""
        try:
            return Progress.model_validate_json(self._progress.read_bytes())
        except (OSError, ValidationError):
            return Progress()

    def end(self, outcome: Outcome) -> None:
        """Write how the flight ended."""
        write_private(self._outcome, outcome.model_dump_json(indent=2))

    def outcome(self) -> Outcome | None:
        """How the flight ended; None before, or where its process was killed."""
        try:
            return Outcome.model_validate_json(self._outcome.read_bytes())
        except (OSError, ValidationError):
            return None
