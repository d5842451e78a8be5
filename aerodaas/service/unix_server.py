"""Listening Unix socket that is open to this user alone, each connection served in a thread."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
from collections.abc import Callable
from pathlib import Path

__all__ = ["UnixServer", "fits_a_socket"]

_LONGEST_PATH = 100
"""Bytes that a Unix socket's path may have on Linux (108), less some."""


def fits_a_socket(path: Path) -> bool:
    """Whether a path is short enough for a Unix socket."""
    return len(os.fsencode(path)) <= _LONGEST_PATH


class UnixServer:
    """Accepts connections until it is closed."""

    def __init__(
        self, path: Path, serve: Callable[[socket.socket], None], *, name: str, most: int
    ) -> None:
        """Listen at `path`, in the place of whatever was there.

        Args:
            path: Of the socket, see `fits_a_socket`.
            serve: Serves one connection, which is closed afterwards, in a thread of its own.
            name: Of the thread that accepts.
            most: Connections at once; one more is closed at once.
        """
        self.closed = threading.Event()
        """Set once no more are accepted: `serve` is to end its connection."""
        self._serve = serve
        self._name = name
        self._places = threading.BoundedSemaphore(most)
        path.unlink(missing_ok=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.bind(str(path))
        path.chmod(0o600)
        self._socket.listen()

    def start(self) -> None:
        """Accept connections, in a thread of its own."""
        threading.Thread(target=self._accept, name=self._name, daemon=True).start()

    def close(self) -> None:
        """Accept no more; the threads of connections end by themselves."""
        self.closed.set()
        # A listener that is only closed keeps a thread in accept().
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _accept(self) -> None:
        while not self.closed.is_set():
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            if not self._places.acquire(blocking=False):
                connection.close()
                continue
            threading.Thread(target=self._served, args=(connection,), daemon=True).start()

    def _served(self, connection: socket.socket) -> None:
        try:
            with connection:
                self._serve(connection)
        finally:
            self._places.release()
