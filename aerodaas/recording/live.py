"""The recording's channels over Foxglove's WebSocket while the mission flies."""

from __future__ import annotations

import threading

import foxglove
from foxglove import Channel, Context
from foxglove.websocket import ChannelView, Client, ServerListener
from typing_extensions import Self

from aerodaas.recording.encoding import Entry
from aerodaas.recording.images import VIDEO_SCHEMAS
from aerodaas.types.errors import ConfigError

__all__ = ["LiveServer"]

_BACKLOG = 256
"""Messages kept for a client that is slow to read; older ones are dropped for it alone."""


class LiveServer(ServerListener):
    """Serves entries to connected viewers; almost free without one.

    A client that comes later, or turns a channel on, gets the channel's last message at once:
    the plan, the fence and the calibration are written only when they change.
    """

    def __init__(self, address: str, name: str = "") -> None:
        """Listen at `address`, `host:port`; port 0 takes a free one. Raises ConfigError."""
        host, _, port = address.rpartition(":")
        if not host or not port.isdigit():
            raise ConfigError(f"a live view is served at host:port, not at {address!r}")
        self._context = Context()
        self._channels: dict[str, Channel] = {}
        self._last: dict[str, tuple[bytes, int]] = {}
        self._lock = threading.Lock()
        try:
            self._server = foxglove.start_server(
                name=name or "AeroDaaS",
                host=host.strip("[]"),
                port=int(port),
                server_listener=self,
                context=self._context,
                message_backlog_size=_BACKLOG,
            )
        except (RuntimeError, OSError, OverflowError, ValueError) as error:
            raise ConfigError(
                f"cannot serve a live view at {address}: {error}; give another --live-address"
            ) from None
        self.port = self._server.port
        """The port that is listened at."""

    def put(self, entry: Entry, log_time: int) -> None:
        """Send an entry, logged at Unix time `log_time` in nanoseconds."""
        channel = self._channels.get(entry.topic) or self._register(entry)
        if entry.schema.name not in VIDEO_SCHEMAS:
            # Of a video, nothing can be seen before the next key frame.
            with self._lock:
                self._last[entry.topic] = (entry.data, log_time)
        channel.log(entry.data, log_time=log_time)

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Repeat a channel's last message for a new viewer."""
        del client
        with self._lock:
            last = self._last.get(channel.topic)
        known = self._channels.get(channel.topic)
        if last is not None and known is not None:
            data, log_time = last
            known.log(data, log_time=log_time)

    def close(self) -> None:
        """Disconnect all viewers."""
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
