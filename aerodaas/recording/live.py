"""Live view of a recording's channels over Foxglove's WebSocket during the mission."""

from __future__ import annotations

import asyncio
import re
import secrets
import threading
from contextlib import suppress
from http import HTTPStatus

import foxglove
from foxglove import Channel, Context
from foxglove.websocket import ChannelView, Client, ServerListener
from typing_extensions import Self

from aerodaas.cameras.images import VIDEO_SCHEMAS
from aerodaas.errors import ConfigError
from aerodaas.http_server.addresses import host_name, is_loopback, is_served, listen
from aerodaas.http_server.denial import answer_of
from aerodaas.recording.encoding import Entry

__all__ = ["LiveServer"]

_MOST_HEAD = 16 << 10
_MOST_CLIENTS = 64
_PATIENCE = 5.0
"""Seconds for a client's request."""
_CHUNK = 1 << 16
_VIEWERS = frozenset({b"https://app.foxglove.dev", b"file://"})
"""Origins of Foxglove in a browser and on the desktop."""
_HEADER = re.compile(rb"^([!-9;-~]+):[ \t]*(.*?)[ \t]*\r?$", re.MULTILINE)
_REFUSED = answer_of(
    HTTPStatus.FORBIDDEN,
    "the live view answers to this machine's names and to Foxglove only: open it by the address "
    "told",
)
_BACKLOG = 256
"""Messages queued for a slow client; older ones are dropped for this client only."""


class LoopbackProxy:
    """Passes connections on to a local server once their request names this machine.

    A web page of a stranger's, or one whose name has been made to resolve to this machine, is
    refused; so are requests that are too long or too slow.
    """

    def __init__(self, host: str, port: int, target: tuple[str, int]) -> None:
        """Listen at `host`:`port` and pass on to `target`; raises OSError."""
        self._socket = listen(host, port)
        self.port: int = self._socket.getsockname()[1]
        """Port that it listens on."""
        self._host = host
        self._target = target
        self._clients: set[asyncio.Task[None]] = set()
        self._loop = asyncio.new_event_loop()
        self._server = self._loop.run_until_complete(
            asyncio.start_server(self._serve, sock=self._socket, limit=_MOST_HEAD)
        )
        self._thread = threading.Thread(target=self._run, name="live view", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening and end all connections."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_PATIENCE)
        self._socket.close()

    def _run(self) -> None:
        self._loop.run_forever()
        self._loop.run_until_complete(self._end())
        self._loop.close()

    async def _end(self) -> None:
        self._server.close()
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None  # noqa: S101 - it runs in one
        try:
            if len(self._clients) < _MOST_CLIENTS:
                self._clients.add(task)
                await self._pass_on(reader, writer)
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
            pass
        except asyncio.TimeoutError:
            pass
        finally:
            self._clients.discard(task)
            writer.close()

    async def _pass_on(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _PATIENCE)
        if not self._admits(head):
            writer.write(_REFUSED)
            await writer.drain()
            return
        inner, outer = await asyncio.open_connection(*self._target)
        try:
            outer.write(head)
            ways = [
                asyncio.ensure_future(_copy(reader, outer)),
                asyncio.ensure_future(_copy(inner, writer)),
            ]
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            for way in ways:
                way.cancel()
            await asyncio.gather(*ways, return_exceptions=True)
        finally:
            outer.close()

    def _admits(self, head: bytes) -> bool:
        headers: dict[bytes, list[bytes]] = {}
        for name, value in _HEADER.findall(head):
            headers.setdefault(name.lower(), []).append(value)
        hosts, origins = headers.get(b"host", []), headers.get(b"origin", [])
        if len(hosts) != 1 or len(origins) > 1:
            return False
        if not is_served(host_name(hosts[0]), self._host):
            return False
        if not origins or origins[0] in _VIEWERS:
            return True
        name = origins[0].partition(b"://")[2]
        return name == hosts[0] or is_loopback(host_name(name))


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while data := await reader.read(_CHUNK):
            writer.write(data)
            await writer.drain()


class LiveServer(ServerListener):
    """Foxglove WebSocket server for recorded entries; nearly free of cost without clients.

    A client that connects later, or subscribes to a channel, gets the channel's last message at
    once: the plan, the geofence and the calibration are written only when they change.
    """

    def __init__(self, address: str, name: str = "") -> None:
        """Start the server.

        Args:
            address: `host:port` to listen on; port 0 selects a free one.
            name: Server name shown to clients; empty for `AeroDaaS`.

        Raises:
            ConfigError: If the address is malformed or cannot be listened on.
        """
        host, _, port = address.rpartition(":")
        if not host or not port.isdigit():
            raise ConfigError(f"a live view is served at host:port, not at {address!r}")
        self._context = Context()
        self._channels: dict[str, Channel] = {}
        self._last: dict[str, tuple[bytes, int]] = {}
        self._lock = threading.Lock()
        parts = (1 + secrets.randbelow(254) for _ in range(3))
        inner = ".".join(map(str, (127, *parts)))
        try:
            self._server = foxglove.start_server(
                name=name or "AeroDaaS",
                # Behind the gate, at an address that no web page can guess.
                host=inner,
                port=0,
                server_listener=self,
                context=self._context,
                message_backlog_size=_BACKLOG,
            )
            try:
                self._gate = LoopbackProxy(host.strip("[]"), int(port), (inner, self._server.port))
            except BaseException:
                self._server.stop()
                raise
        except (RuntimeError, OSError, OverflowError, ValueError) as error:
            raise ConfigError(
                f"cannot serve a live view at {address}: {error}; give another --live-address"
            ) from None
        self.port = self._gate.port
        """Port that the server listens on."""

    def put(self, entry: Entry, log_time: int) -> None:
        """Send an entry.

        Args:
            entry: The entry.
            log_time: Its log time, nanoseconds since the Unix epoch.
        """
        channel = self._channels.get(entry.topic) or self._register(entry)
        if entry.schema.name not in VIDEO_SCHEMAS:
            # A repeated video message cannot be decoded before the next key frame.
            with self._lock:
                self._last[entry.topic] = (entry.data, log_time)
        channel.log(entry.data, log_time=log_time)

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Repeat a channel's last message for a new subscriber.

        Args:
            client: Ignored.
            channel: The channel.
        """
        del client
        with self._lock:
            last = self._last.get(channel.topic)
        known = self._channels.get(channel.topic)
        if last is not None and known is not None:
            data, log_time = last
            known.log(data, log_time=log_time)

    def close(self) -> None:
        """Stop the server and disconnect all clients."""
        self._gate.close()
        self._server.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _register(self, entry: Entry) -> Channel:
        encoding = "json" if entry.schema.encoding == "jsonschema" else entry.schema.encoding
        channel = Channel(
            entry.topic, schema=entry.schema, message_encoding=encoding, context=self._context
        )
        self._channels[entry.topic] = channel
        return channel
