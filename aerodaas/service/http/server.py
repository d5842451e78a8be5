"""Web servers that do not wait for ever: a connection that asks nothing makes room for others.

A server bounds its connections, so whoever opens all of them and says nothing, or says it a byte a
minute ("slowloris"), or does not take the answer, would shut everybody out. uvicorn bounds only the
time between two requests. Where all connections are taken, the oldest that awaits a request is
closed for a new one, of the address that has most of these. WebSocket messages that are not whole
are bounded in time, and in memory for all connections together.
"""

from __future__ import annotations

import socket
import threading
from collections import OrderedDict, defaultdict
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import uvicorn
from uvicorn.protocols.http.auto import AutoHTTPProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from aerodaas.service.http.limits import RequestLimits

if TYPE_CHECKING:
    import asyncio

    from starlette.types import ASGIApp
    from uvicorn.protocols.http.h11_impl import H11Protocol as _Protocol
else:
    _Protocol = AutoHTTPProtocol

__all__ = ["AppServer", "web_server"]

_TRY_AGAIN_LATER, _POLICY_VIOLATION = 1013, 1008
"""Codes by which a WebSocket is closed (RFC 6455)."""


def web_server(app: Any, limits: RequestLimits, **settings: Any) -> uvicorn.Server:  # noqa: ANN401 - uvicorn's
    """A server of an ASGI application whose connections are limited in number and in time.

    Args:
        app: The application.
        limits: Limits of the server; beyond its connections a request is answered by 503, unless
            a connection that awaits a request makes room for it.
        settings: Further ones of `uvicorn.Config`.
    """
    config = _Config(
        app,
        http=_ImpatientProtocol,
        ws=_ImpatientWebSocket,
        limit_concurrency=limits.connections,
        log_config=None,
        access_log=False,
        server_header=False,
        ws_max_size=limits.message_bytes,
        ws_ping_interval=limits.ping_seconds,
        ws_ping_timeout=limits.ping_seconds,
        # It would compress each picture anew for each watcher, and pictures are compressed.
        ws_per_message_deflate=False,
        **settings,
    )
    return uvicorn.Server(config)


class _Connections:
    """Connections of one server that await a request, and WebSocket messages not yet whole."""

    def __init__(self) -> None:
        self._awaiting: defaultdict[str, OrderedDict[_ImpatientProtocol, None]]
        self._awaiting = defaultdict(OrderedDict)
        """By address, the oldest first."""
        self._unfinished: dict[_ImpatientWebSocket, int] = {}
        """Bytes by connection, the message that began first before the others."""

    def await_request(self, connection: _ImpatientProtocol) -> None:
        """Note that a connection may make room for another one."""
        self._awaiting[connection.address].setdefault(connection)

    def keep(self, connection: _ImpatientProtocol) -> None:
        """Note that a connection has a request, or has ended."""
        connections = self._awaiting[connection.address]
        connections.pop(connection, None)
        if not connections:
            del self._awaiting[connection.address]

    def make_room(self, newcomer: _ImpatientProtocol) -> None:
        """Close the oldest connection without a request, of the address with most of them."""
        oldest = next(iter(max(self._awaiting.values(), key=len)))
        if oldest is not newcomer:
            self.keep(oldest)
            oldest.transport.abort()
            # Its end is told later than a request of the new one may be.
            oldest.connections.discard(oldest)

    def hold(self, connection: _ImpatientWebSocket, size: int) -> None:
        """Note the bytes that are kept of a message; the oldest ones end for too many of all."""
        if size:
            self._unfinished[connection] = size
        else:
            self._unfinished.pop(connection, None)
        while sum(self._unfinished.values()) > RequestLimits.unfinished_bytes:
            oldest = next(iter(self._unfinished))
            del self._unfinished[oldest]
            oldest.give_up(_TRY_AGAIN_LATER, "too many unfinished messages: connect again")


class _Config(uvicorn.Config):
    """Settings of one server, with what its connections share."""

    def __init__(self, *words: Any, **settings: Any) -> None:  # noqa: ANN401 - uvicorn's
        super().__init__(*words, **settings)
        self.most: int = settings["limit_concurrency"]
        self.shared = _Connections()


class _ImpatientWebSocket(WebSocketsSansIOProtocol):
    """Closes a connection whose message does not become whole in time."""

    config: _Config
    _closing: asyncio.TimerHandle | None = None

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if len(self.frames) > RequestLimits.fragments:
            # Fragments of a byte take forty times their size.
            self.frames = [b"".join(self.frames)]
        size = len(self.conn.reader.buffer) + sum(map(len, self.frames))
        self.config.shared.hold(self, size)
        if not size:
            self._stop()
        elif self._closing is None:
            self._closing = self.loop.call_later(RequestLimits.message_seconds, self._require_whole)

    def send_receive_event_to_app(self) -> None:
        super().send_receive_event_to_app()
        self._stop()

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop()
        self.config.shared.hold(self, 0)
        super().connection_lost(exc)

    def give_up(self, code: int, reason: str) -> None:
        """Close the connection with a reason."""
        self._stop()
        if not self.close_sent and not self.transport.is_closing():
            self.conn.fail(code, reason)
            self.close_sent = True
            self.transport.write(b"".join(self.conn.data_to_send()))
            self.transport.close()

    def _require_whole(self) -> None:
        self._closing = None
        if self.read_paused:
            # It is not the client who is waited for.
            self._closing = self.loop.call_later(RequestLimits.message_seconds, self._require_whole)
        else:
            text = f"a message is whole within {RequestLimits.message_seconds:g} s: send it faster"
            self.give_up(_POLICY_VIOLATION, text)

    def _stop(self) -> None:
        if self._closing is not None:
            self._closing.cancel()
            self._closing = None


class _ImpatientProtocol(_Protocol):
    """Closes a connection whose request does not become whole in time, or whose answer stays."""

    config: _Config
    address = ""
    """From which the connection comes."""
    _awaited = 0.0
    """Seconds granted to what is awaited now; 0 while a request is answered."""
    _closing: asyncio.TimerHandle | None = None
    _taking: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        # So that it is told of any byte that waits: a connection that is closed waits for the last.
        transport.set_write_buffer_limits(high=0)
        self.address = self.client[0] if self.client else ""
        self._wait()
        if len(self.connections) >= self.config.most:
            self.config.shared.make_room(self)

    def pause_writing(self) -> None:
        super().pause_writing()
        self._await_taking()

    def resume_writing(self) -> None:
        super().resume_writing()
        self._stop_taking()
        self._update_awaiting()

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
        self.config.shared.keep(self)
        self._stop_waiting()
        self._stop_taking()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._update_awaiting()

    def _wait(self) -> None:
        """Start the clock where something else is awaited than before; more bytes of it do not."""
        self._update_awaiting()
        seconds = self._seconds()
        if seconds != self._awaited:
            self._stop_waiting()
            self._awaited = seconds
            if seconds:
                self._closing = self.loop.call_later(seconds, self.transport.close)

    def _update_awaiting(self) -> None:
        # One whose answer is still on its way makes no room.
        if self._awaits_request() and not self.transport.get_write_buffer_size():
            self.config.shared.await_request(self)
        else:
            self.config.shared.keep(self)

    def _awaits_request(self) -> bool:
        if self.transport.get_protocol() is not self or self.transport.is_closing():
            return False  # a WebSocket, which has pings of its own, or one that ends
        cycle = self.cycle
        return cycle is None or cycle.response_complete  # pyright: ignore[reportUnnecessaryComparison]

    def _seconds(self) -> float:
        if self._awaits_request():
            return RequestLimits.head_seconds
        if self.transport.get_protocol() is not self:
            return 0.0
        return RequestLimits.body_seconds if self.cycle.more_body else 0.0

    def _await_taking(self) -> None:
        waiting = self.transport.get_write_buffer_size()
        self._taking = self.loop.call_later(
            RequestLimits.answer_seconds, self._require_taken, waiting
        )

    def _require_taken(self, before: int) -> None:
        if before - self.transport.get_write_buffer_size() < RequestLimits.answer_bytes:
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
        self._server = web_server(build(), self._limits, timeout_graceful_shutdown=1)
        if not self._closed.is_set():
            self._server.run(sockets=[self._listener])
