"""Logs that a vehicle keeps itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from aerodaas.types.vehicle import Vehicle

__all__ = ["LogEntry", "LoggingVehicle"]


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One log on a vehicle."""

    number: int
    size: int
    """Bytes."""
    began: float | None
    """Seconds since the Unix epoch; None where the vehicle did not know the date."""


@runtime_checkable
class LoggingVehicle(Vehicle, Protocol):
    """A vehicle whose own logs can be fetched. Both methods block."""

    def logs(self) -> list[LogEntry]:
        """Its logs, oldest first; raises VehicleError."""
        ...

    def fetch_log(
        self, log: LogEntry, folder: Path, progress: Callable[[int, int], None] = ...
    ) -> Path:
        """Fetch one into a new file of `folder`; raises VehicleError.

        `progress` is called with the bytes fetched and those of all.
        """
        ...
