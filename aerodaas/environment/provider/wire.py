"""WebSockets to a provider's service: messages of JSON, each with a blob or without."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError
from typing_extensions import Self

from aerodaas.config.extras import require_extra
from aerodaas.environment.provider.exchange import ProviderConnection, printed
from aerodaas.protocol.schemas import MissionOut

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

__all__ = ["LiveConnection", "ReceivedItem", "WireConnection"]

_OPEN_SECONDS = 10.0
_LARGEST = 64 << 20
"""Bytes of one message: a picture of 4K with its depth, uncompressed."""


class WireConnection:
    """An open connection; one thread receives, any may send or close."""

    def __init__(
        self, exchange: ProviderConnection, connection: ClientConnection, stack: ExitStack
    ) -> None:
        """Speak over `connection`, which `stack` closes; errors are worded by `exchange`."""
        self.exchange = exchange
        self._connection = connection
        self._stack = stack
        # A message's two parts stay together.
        self._sending = threading.Lock()

    @classmethod
    def open(cls, exchange: ProviderConnection, path: str) -> Self:
        """Connect by a WebSocket.

        Args:
            exchange: Connection to the provider, with its address and headers.
            path: Path of the resource, with its query.

        Raises:
            ConfigError: Without the package for WebSockets.
            SourceError: Without a connection.
            AeroDaaSError: The refusal, with its status and text.
        """
        require_extra("remote", "following a provider's mission")
        from websockets.exceptions import (  # noqa: PLC0415 - only to follow
            InvalidHandshake,
            InvalidStatus,
        )
        from websockets.sync.client import connect  # noqa: PLC0415 - as above

        stack = ExitStack()
        try:
            connection = stack.enter_context(
                connect(
                    f"{exchange.address.websocket}{path}",
                    additional_headers=exchange.headers,
                    ssl=exchange.ssl,
                    proxy=None,
                    open_timeout=_OPEN_SECONDS,
                    close_timeout=1.0,
                    max_size=_LARGEST,
                )
            )
        except InvalidStatus as error:
            answer = error.response
            raise exchange.refusal(answer.status_code, bytes(answer.body or b"")) from None
        except InvalidHandshake as error:
            raise exchange.unreachable(error) from None
        except (OSError, EOFError) as error:
            raise exchange.unreachable(error) from None
        return cls(exchange, connection, stack)

    def __enter__(self) -> Self:
        """Return the connection, which is closed on exit."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connection."""
        self.close()

    def close(self) -> None:
        """Close the connection; whoever receives from it meets SourceError."""
        self._stack.close()

    def send(self, content: dict[str, Any], blob: bytes = b"") -> None:
        """Send a message.

        Args:
            content: JSON of the message.
            blob: Bytes that follow it; none if empty.

        Raises:
            SourceError: If the connection is lost.
        """
        from websockets.exceptions import ConnectionClosed  # noqa: PLC0415 - only to follow

        try:
            with self._sending:
                self._connection.send(json.dumps({**content, "blob": bool(blob)}))
                if blob:
                    self._connection.send(blob)
        except (ConnectionClosed, OSError, EOFError) as error:
            raise self.exchange.unreachable(error) from None

    def receive(self, timeout: float | None) -> tuple[dict[str, Any], bytes]:
        """Receive a message and its blob.

        Raises SourceError if the connection is lost or none came within `timeout` seconds,
        MissionError for one that is not as agreed.
        """
        text = self._part(timeout)
        try:
            message = json.loads(text) if isinstance(text, str) else None
        except (ValueError, RecursionError):
            message = None
        if not isinstance(message, dict):
            raise self.exchange.strange("a message that is no JSON object")
        blob = self._part(timeout) if message.pop("blob", False) else b""
        if isinstance(blob, str):
            raise self.exchange.strange("a message without the bytes that it tells of")
        return message, blob

    def _part(self, timeout: float | None) -> str | bytes:
        from websockets.exceptions import ConnectionClosed  # noqa: PLC0415 - only to follow

        try:
            return self._connection.recv(timeout)
        except TimeoutError:
            text = f"nothing came for {timeout:g} s"
            raise self.exchange.unreachable(TimeoutError(text)) from None
        except (ConnectionClosed, OSError, EOFError) as error:
            raise self.exchange.unreachable(error) from None


_SILENT_SECONDS = 15.0
"""Seconds without a message after which the connection is lost; a service sends one a second."""


@dataclass(frozen=True)
class ReceivedItem:
    """An item of a stream as it arrived."""

    stream: str
    seq: int
    """Counts the messages of the stream; a gap is a drop."""
    content: Any
    """For `wire_items.unpack`."""
    blob: bytes
    left_out: str = ""
    """Why it is not there; empty for one that is."""


class LiveConnection(WireConnection):
    """Connection to a mission; iterate over it until the mission is over.

    Yields the mission at each change, and items. Raises SourceError when the connection is lost,
    MissionError for messages that are not as agreed.
    """

    def __iter__(self) -> Iterator[MissionOut | ReceivedItem]:
        """Yield what arrives until the mission is over."""
        while True:
            message, blob = self.receive(_SILENT_SECONDS)
            kind = message.get("kind")
            if kind == "end":
                return
            if kind == "mission":
                yield self._mission(message)
            elif kind in {"item", "left_out"}:
                yield self._item(message, blob)

    def _mission(self, message: dict[str, Any]) -> MissionOut:
        try:
            return MissionOut.model_validate(printed(message.get("mission")), extra="ignore")
        except ValidationError as error:
            place = ".".join(map(str, error.errors()[0]["loc"]))
            raise self.exchange.strange(f"the mission's {place}") from None

    def _item(self, message: dict[str, Any], blob: bytes) -> ReceivedItem:
        stream, seq = message.get("stream"), message.get("seq")
        if not isinstance(stream, str) or not isinstance(seq, int):
            raise self.exchange.strange("an item without its stream or number")
        left_out = ""
        if message["kind"] == "left_out":
            left_out = str(printed(message.get("reason"))) or "the provider does not say why"
        return ReceivedItem(stream, seq, message.get("item"), blob, left_out)
