"""Channel: bounded messages over a Unix socket, of JSON and one blob each."""

from __future__ import annotations

import json
import socket
import struct
import time
from typing import Any

from aerodaas.errors import AeroDaaSError

__all__ = ["HEAD", "LARGEST_TEXT", "Channel", "ChannelError"]

LARGEST_TEXT = 4 << 20
"""Bytes of a message's JSON."""
_LARGEST_BLOB = 64 << 20
"""Bytes of a message's blob: a picture."""
HEAD = struct.Struct("<II")
"""Before each message: bytes of its JSON, and of its blob."""


class ChannelError(AeroDaaSError):
    """The other process has ended, is silent, or sent what is no valid message."""


class Channel:
    """One end of a connection."""

    def __init__(self, connection: socket.socket) -> None:
        """Exchange messages over `connection`."""
        self._socket = connection

    def send(self, text: dict[str, Any], blob: bytes = b"", timeout: float | None = None) -> None:
        """Send one message; raises ChannelError if it is too large or not taken in time."""
        data = json.dumps(text).encode()
        if len(data) > LARGEST_TEXT or len(blob) > _LARGEST_BLOB:
            raise ChannelError(f"a message of {len(data)} and {len(blob)} bytes is too large")
        try:
            self._socket.settimeout(timeout)
            self._socket.sendall(HEAD.pack(len(data), len(blob)) + data + blob)
        except TimeoutError:
            raise ChannelError(f"took no message for {timeout:g} s") from None
        except OSError as error:
            raise ChannelError(f"its process has ended ({error.strerror})") from None

    def receive(self, timeout: float | None = None) -> tuple[dict[str, Any], bytes]:
        """Receive one message; raises ChannelError for none in time, and for a malformed one."""
        data, blob = self.receive_bytes(timeout)
        try:
            found = json.loads(data)
        except (ValueError, RecursionError):
            raise ChannelError("sent a message that is not JSON") from None
        if not isinstance(found, dict):
            raise ChannelError("sent a message that is no JSON object")
        return found, blob

    def receive_bytes(self, timeout: float | None = None) -> tuple[bytes, bytes]:
        """As `receive`, with the JSON as it came."""
        until = None if timeout is None else time.monotonic() + timeout
        text, blob = HEAD.unpack(self._read(HEAD.size, until))
        if text > LARGEST_TEXT or blob > _LARGEST_BLOB:
            raise ChannelError(
                f"sent a message of {text} and {blob} bytes; the most are {LARGEST_TEXT} and "
                f"{_LARGEST_BLOB}"
            )
        return self._read(text, until), self._read(blob, until)

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def _read(self, size: int, until: float | None) -> bytes:
        data = bytearray()
        while len(data) < size:
            left = None if until is None else max(1e-3, until - time.monotonic())
            try:
                self._socket.settimeout(left)
                part = self._socket.recv(min(1 << 20, size - len(data)))
            except TimeoutError:
                part = b""
                if until is not None and time.monotonic() >= until:
                    raise ChannelError("did not answer in time") from None
                continue
            except OSError as error:
                raise ChannelError(f"its process has ended ({error.strerror})") from None
            if not part:
                raise ChannelError("its process has ended")
            data += part
            if until is not None and time.monotonic() > until and len(data) < size:
                raise ChannelError("did not answer in time")
        return bytes(data)
