"""Files that extensions write beside a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

from aerodaas.config.model import EnvironmentConfig
from aerodaas.messages.envelope import Message

__all__ = ["SidecarWriter"]


class SidecarWriter:
    """Writer of files beside one recording (`Extension.sidecar_writers`), in the recorder's thread.

    What it cannot write ends neither the recording nor the flight.
    """

    kind: ClassVar[str] = "recording"
    """Kind of the alert about what it cannot write."""

    def __init__(self, recording: Path, environment: EnvironmentConfig) -> None:
        """Prepare for a new recording.

        Args:
            recording: Path of the MCAP file.
            environment: The run's environment file.
        """

    def write(self, message: Message[Any]) -> None:
        """Write what is of use of a recorded message; raises RecordingError where it cannot."""

    def close(self) -> None:
        """Finish the files."""
