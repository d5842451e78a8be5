"""The control socket's messages for an event loop; `analytics.here.channel` has the others.

Their JSON is passed on as it is: who parses what a user has sent is the user's own flight.
"""

from __future__ import annotations

import asyncio
import json

from typing_extensions import Self

from aerodaas.analytics.here.channel import HEAD, ChannelError
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
        """Connect for a purpose; raises ChannelError if nobody listens there."""
        try:
            channel = cls(*await asyncio.open_unix_connection(str(folder.socket)))
        except OSError as error:
            raise ChannelError(f"the flight does not answer: {error.strerror}") from None
        await channel.send(json.dumps({"for": purpose}).encode())
        return channel

    async def send(self, text: bytes) -> None:
        """Send a message of JSON; raises ChannelError if nobody is there any more."""
        try:
            self._writer.write(HEAD.pack(len(text), 0) + text)
            await self._writer.drain()
        except OSError as error:
            raise ChannelError(f"the flight has ended: {error.strerror}") from None

    async def receive(self) -> tuple[bytes, bytes]:
        """Receive one message, JSON and a blob; raises ChannelError if nobody is there any more."""
        try:
            text, blob = HEAD.unpack(await self._reader.readexactly(HEAD.size))
            data = await self._reader.readexactly(text)
            return data, await self._reader.readexactly(blob)
        except (OSError, asyncio.IncompleteReadError) as error:
            raise ChannelError(f"the flight has ended: {error}") from None

    def close(self) -> None:
        """Close the connection."""
        self._writer.close()
