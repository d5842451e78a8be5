"""Listening Unix sockets that are open to this user alone, and a server of one by threads."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
from collections.abc import Callable
from pathlib import Path

__all__ = ["UnixServer", "fits_a_socket", "listen_unix"]

_LONGEST_PATH = 100
"""Bytes that a Unix socket's path may have on Linux (108), less some."""


def fits_a_socket(path: Path) -> bool:
    """Whether a path is short enough for a Unix socket."""
    return len(os.fsencode(path)) <= _LONGEST_PATH


def listen_unix(path: Path) -> socket.socket:
    """Listen at `path`, in the place of whatever was there; raises OSError."""
    path.unlink(missing_ok=True)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        listener.bind(str(path))
        path.chmod(0o600)
        listener.listen()
    except OSError:
        listener.close()
        raise
    return listener


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
        """Set once no more are accepted."""
        self._serve = serve
        self._name = name
        self._most = most
        self._lock = threading.Lock()
        self._open: set[socket.socket] = set()
        self._socket = listen_unix(path)

    def start(self) -> None:
        """Accept connections, in a thread of its own."""
        threading.Thread(target=self._accept, name=self._name, daemon=True).start()

    def close(self) -> None:
        """Accept no more, and end all connections, whose threads notice it."""
        self.closed.set()
        with self._lock:
            # A listener that is only closed keeps a thread in accept().
            for one in (self._socket, *self._open):
                with contextlib.suppress(OSError):
                    one.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _accept(self) -> None:
        while not self.closed.is_set():
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            with self._lock:
                welcome = len(self._open) < self._most and not self.closed.is_set()
                if welcome:
                    self._open.add(connection)
            if not welcome:
                connection.close()
                continue
            threading.Thread(target=self._served, args=(connection,), daemon=True).start()

    def _served(self, connection: socket.socket) -> None:
        try:
            with connection:
                self._serve(connection)
        finally:
            with self._lock:
                self._open.discard(connection)
