"""The control socket's messages for an event loop; `analytics.guests.channel` has the others."""

from __future__ import annotations

import asyncio
import json
from typing import Any

from typing_extensions import Self

from aerodaas.analytics.guests.channel import HEAD, LARGEST_BLOB, LARGEST_TEXT, GuestError
from aerodaas.service.flights.folder import FlightFolder

__all__ = ["AsyncChannel"]


class AsyncChannel:
    """One connection to a flight."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Exchange messages over an open connection; see `connect`."""
        self._reader = reader
        self._writer = writer

    @classmethod
    async def connect(cls, folder: FlightFolder, purpose: str) -> Self:
        """Connect for a purpose; raises GuestError if nobody listens there."""
        try:
            channel = cls(*await asyncio.open_unix_connection(str(folder.socket)))
        except OSError as error:
            raise GuestError(f"the flight does not answer: {error.strerror}") from None
        await channel.send({"for": purpose})
        return channel

    async def send(self, text: dict[str, Any], blob: bytes = b"") -> None:
        """Send one message; raises GuestError if it is too large, or nobody is there any more."""
        data = json.dumps(text).encode()
        if len(data) > LARGEST_TEXT or len(blob) > LARGEST_BLOB:
            raise GuestError(f"a message of {len(data)} and {len(blob)} bytes is too large")
        try:
            self._writer.write(HEAD.pack(len(data), len(blob)) + data + blob)
            await self._writer.drain()
        except OSError as error:
            raise GuestError(f"the flight has ended: {error.strerror}") from None

    async def receive(self) -> tuple[dict[str, Any], bytes]:
        """Receive one message; raises GuestError when nobody is there any more."""
        try:
            text, blob = HEAD.unpack(await self._reader.readexactly(HEAD.size))
            data = await self._reader.readexactly(text)
            return json.loads(data), await self._reader.readexactly(blob)
        except (OSError, asyncio.IncompleteReadError) as error:
            raise GuestError(f"the flight has ended: {error}") from None

    def close(self) -> None:
        """Close the connection."""
        self._writer.close()
