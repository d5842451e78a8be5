"""Logs that a vehicle keeps itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

__all__ = ["LogEntry", "LogService", "log_of_flight"]


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One log on a vehicle."""

    number: int
    size: int
    """Bytes."""
    began: float | None
    """Seconds since the Unix epoch; None where the vehicle does not tell, or knew no date."""
    ended: float | None = None
    """When it was last written, the same way; of one that is being written, the present."""


def log_of_flight(logs: Sequence[LogEntry], begin: float, end: float) -> LogEntry | None:
    """The log that was written during a flight, by the middle of it; None where no time tells.

    The vehicle's clock and ours may differ by half a flight.

    Args:
        logs: The vehicle's logs.
        begin: Seconds since the Unix epoch at which the flight began.
        end: Those at which it ended.
    """
    middle = (begin + end) / 2.0
    before = [log for log in logs if log.began is not None and log.began <= middle]
    after = [log for log in logs if log.ended is not None and log.ended >= middle]
    if after:
        return min(after, key=lambda log: (log.ended, log.number))
    return max(before, key=lambda log: (log.began, log.number), default=None)


@runtime_checkable
class LogService(Protocol):
    """A vehicle's own logs, or a vehicle that hands them out itself. Both methods block."""

    def logs(self) -> list[LogEntry]:
        """Its logs, oldest first; raises VehicleError."""
        ...

    def fetch_log(
        self, log: LogEntry, folder: Path, progress: Callable[[int, int], None] = ...
    ) -> Path:
        """Fetch a log into a new file.

        Args:
            log: The log, one of `logs`.
            folder: Folder of the file.
            progress: Called with the bytes fetched and those of all.

        Returns:
            Path of the file.

        Raises:
            VehicleError: If it cannot be fetched.
        """
        ...
