"""Live view of a recording's channels over Foxglove's WebSocket during the mission."""

from __future__ import annotations

import secrets
import threading

import foxglove
from foxglove import Channel, Context
from foxglove.websocket import ChannelView, Client, ServerListener
from typing_extensions import Self

from aerodaas.cameras.images import VIDEO_SCHEMAS
from aerodaas.errors import ConfigError
from aerodaas.recording.encoding import Entry
from aerodaas.recording.web_gate import WebGate

__all__ = ["LiveServer"]

_BACKLOG = 256
"""Messages queued for a slow client; older ones are dropped for this client only."""


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
                self._gate = WebGate(host.strip("[]"), int(port), (inner, self._server.port))
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
        """Send an entry with the log time `log_time`, Unix nanoseconds."""
        channel = self._channels.get(entry.topic) or self._register(entry)
        if entry.schema.name not in VIDEO_SCHEMAS:
            # A repeated video message cannot be decoded before the next key frame.
            with self._lock:
                self._last[entry.topic] = (entry.data, log_time)
        channel.log(entry.data, log_time=log_time)

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Repeat a channel's last message for a new subscriber."""
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
