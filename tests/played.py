"""A recording as it is served to a page."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from aerodaas.recording.reader import Recording
from aerodaas.service.own.recordings import RecordingServer

__all__ = ["served"]


@contextmanager
def served(*paths: Path) -> Iterator[str]:
    """The address of the page of one recording, or of several."""
    server = RecordingServer("127.0.0.1:0", [Recording.open(path) for path in paths])
    try:
        yield server.address_of()
    finally:
        server.close()
