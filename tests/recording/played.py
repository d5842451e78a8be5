"""A recording as it is served to a page."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from aerodaas.console.viewer import RecordingServer
from aerodaas.recording.reader import Recording

__all__ = ["served"]


@contextmanager
def served(path: Path) -> Iterator[str]:
    """The address of a recording's page."""
    server = RecordingServer("127.0.0.1:0", Recording.open(path))
    try:
        yield server.address(viewer=True)
    finally:
        server.close()
