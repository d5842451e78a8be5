"""Web servers that do not wait for ever: a connection that asks nothing makes room for others.

A server bounds its connections, so whoever opens all of them and says nothing, or says it a byte a
minute ("slowloris"), or does not take the answer, would shut everybody out. uvicorn bounds only the
time between two requests.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import uvicorn
from uvicorn.protocols.http.auto import AutoHTTPProtocol

if TYPE_CHECKING:
    import asyncio

    from uvicorn.protocols.http.h11_impl import H11Protocol as _Protocol
else:
    _Protocol = AutoHTTPProtocol

__all__ = ["web_server"]

_HEAD_SECONDS = 10.0
"""From the connection, or the first byte of a further request, to the end of its headers."""
_BODY_SECONDS = 300.0
"""For a body: 64 MiB, the largest model, by 2 Mbit/s."""
_TAKEN_SECONDS, _TAKEN_BYTES = 30.0, 30_000
"""A client takes so many of the bytes that wait for it, or all of them, in so many seconds."""


def web_server(app: Any, *, most_connections: int, **settings: Any) -> uvicorn.Server:  # noqa: ANN401 - uvicorn's
    """A server of an ASGI application with bounds on connections and on a request's time.

    Args:
        app: The application.
        most_connections: Connections at a time; a request of a further one is answered by 503.
        settings: Further ones of `uvicorn.Config`.
    """
    config = uvicorn.Config(
        app,
        http=_ImpatientProtocol,
        limit_concurrency=most_connections,
        log_config=None,
        access_log=False,
        server_header=False,
        **settings,
    )
    return uvicorn.Server(config)


class _ImpatientProtocol(_Protocol):
    """Closes a connection whose request does not become whole in time, or whose answer stays."""

    _awaited = 0.0
    """Seconds granted to what is awaited now; 0 while a request is answered."""
    _closing: asyncio.TimerHandle | None = None
    _taking: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        # So that it is told of any byte that waits: a connection that is closed waits for the last.
        transport.set_write_buffer_limits(high=0)
        self._wait()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._await_taking()

    def resume_writing(self) -> None:
        super().resume_writing()
        self._stop_taking()

    def handle_websocket_upgrade(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        *more: Any,  # noqa: ANN401 - of one of the two protocols
    ) -> None:
        self.transport.set_write_buffer_limits()
        super().handle_websocket_upgrade(*more)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        self._wait()

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        self._stop_waiting()
        self._stop_taking()

    def _wait(self) -> None:
        """Start the clock where something else is awaited than before; more bytes of it do not."""
        seconds = self._seconds()
        if seconds != self._awaited:
            self._stop_waiting()
            self._awaited = seconds
            if seconds:
                self._closing = self.loop.call_later(seconds, self.transport.close)

    def _seconds(self) -> float:
        if self.transport.get_protocol() is not self:
            return 0.0  # a WebSocket, which has pings of its own
        cycle = self.cycle
        if cycle is None or cycle.response_complete:  # pyright: ignore[reportUnnecessaryComparison]
            return _HEAD_SECONDS
        return _BODY_SECONDS if cycle.more_body else 0.0

    def _await_taking(self) -> None:
        waiting = self.transport.get_write_buffer_size()
        self._taking = self.loop.call_later(_TAKEN_SECONDS, self._require_taken, waiting)

    def _require_taken(self, before: int) -> None:
        if before - self.transport.get_write_buffer_size() < _TAKEN_BYTES:
            self.transport.abort()
        else:
            self._await_taking()

    def _stop_taking(self) -> None:
        if self._taking is not None:
            self._taking.cancel()
            self._taking = None

    def _stop_waiting(self) -> None:
        self._awaited = 0.0
        if self._closing is not None:
            self._closing.cancel()
            self._closing = None
