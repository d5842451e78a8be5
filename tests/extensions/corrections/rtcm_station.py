"""A base station on loopback."""

from __future__ import annotations

import socket
from types import TracebackType

from typing_extensions import Self

from aerodaas.extensions.corrections.corrections import crc24q

__all__ = ["BaseStation", "rtcm"]

_HOST = "127.0.0.1"


def rtcm(payload: bytes) -> bytes:
    """A message with this payload of at most 1023 bytes."""
    head = b"\xd3" + len(payload).to_bytes(2, "big") + payload
    return head + crc24q(head).to_bytes(3, "big")


class BaseStation:
    """Listens on TCP for as long as the `with` lasts, and sends what it is told to."""

    def __init__(self, port: int = 0) -> None:
        self._server = socket.create_server((_HOST, port))
        self._server.settimeout(10.0)
        self.port: int = self._server.getsockname()[1]
        self._client: socket.socket | None = None

    @property
    def url(self) -> str:
        """Where it is."""
        return f"tcp:{_HOST}:{self.port}"

    def say(self, content: bytes) -> None:
        """Send to the one that listens, once it does."""
        if self._client is None:
            self._client = self._server.accept()[0]
        self._client.sendall(content)

    def hang_up(self) -> None:
        """Close the connection, and go on listening."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.hang_up()
        self._server.close()
