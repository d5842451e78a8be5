"""Server of one ASGI application on a listening socket."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import uvicorn
    from starlette.types import ASGIApp

    from aerodaas.service.http.limits import RequestLimits

__all__ = ["AppServer"]

_STOPPING = 5.0
"""Seconds that the thread has to end."""


class AppServer:
    """Serves an application to who connects to a socket, in a thread, until it is closed."""

    def __init__(self, listener: socket.socket, limits: RequestLimits) -> None:
        """Take over a socket; who connects before `start` is answered then.

        Args:
            listener: Socket that listens; it is closed with the server.
            limits: Limits of its connections.
        """
        self._listener = listener
        self._limits = limits
        self._closed = threading.Event()
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def serving(self) -> bool:
        """Whether it has begun to serve."""
        return self._thread is not None

    def start(self, build: Callable[[], ASGIApp]) -> None:
        """Serve the application that `build` makes, which is called in the server's thread."""
        self._thread = threading.Thread(
            target=self._serve, args=(build,), name="api server", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Stop serving, and listen no more."""
        self._closed.set()
        if self._server is not None:
            self._server.should_exit = True
        if self._thread is not None:
            self._thread.join(_STOPPING)
        self._listener.close()

    def _serve(self, build: Callable[[], ASGIApp]) -> None:
        # uvicorn takes a while to load, in which a flight is launched.
        from aerodaas.service.http.connections import web_server  # noqa: PLC0415

        self._server = web_server(build(), self._limits, timeout_graceful_shutdown=1)
        if not self._closed.is_set():
            self._server.run(sockets=[self._listener])
