"""One live connection to a mission: its state as it changes, and items of its streams."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError
from typing_extensions import Self

from aerodaas.config.extras import require_extra
from aerodaas.environment.provider.exchange import Exchange, printed
from aerodaas.protocol.schemas import MissionOut

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

__all__ = ["LiveConnection", "ReceivedItem"]

_OPEN_SECONDS = 10.0
_SILENT_SECONDS = 15.0
"""Seconds without a message after which the connection is lost; a service sends one a second."""
_LARGEST = 64 << 20
"""Bytes of one message: a picture of 4K with its depth, uncompressed."""


@dataclass(frozen=True)
class ReceivedItem:
    """An item of a stream as it arrived."""

    stream: str
    seq: int
    """Counts the messages of the stream; a gap is a drop."""
    content: Any
    """For `wire_items.unpack`."""
    blob: bytes


class LiveConnection:
    """Connection to a mission; iterate over it until the mission is over.

    Yields the mission at each change, and items. Raises SourceError when the connection is lost,
    MissionError for messages that are not as agreed.
    """

    def __init__(self, exchange: Exchange, connection: ClientConnection) -> None:
        """Read from an open `connection`."""
        self._exchange = exchange
        self._connection = connection

    @classmethod
    def open(cls, exchange: Exchange, path: str, explain: Callable[[], object]) -> LiveConnection:
        """Connect; `explain` raises why, if the service has refused.

        Raises ConfigError without the package for WebSockets, SourceError without a connection.
        """
        require_extra("remote", "following a provider's mission")
        from websockets.exceptions import InvalidHandshake  # noqa: PLC0415 - only to follow
        from websockets.sync.client import connect  # noqa: PLC0415 - as above

        try:
            connection = connect(
                f"{exchange.address.websocket}{path}",
                additional_headers=exchange.headers,
                ssl=exchange.ssl,
                proxy=None,
                open_timeout=_OPEN_SECONDS,
                close_timeout=1.0,
                max_size=_LARGEST,
            )
        except InvalidHandshake as error:
            explain()
            raise exchange.unreachable(error) from None
        except (OSError, EOFError) as error:
            raise exchange.unreachable(error) from None
        return cls(exchange, connection)

    def __enter__(self) -> Self:
        """Return the connection, which is closed on exit."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connection."""
        self.close()

    def close(self) -> None:
        """Close the connection, in any thread; whoever reads from it meets SourceError."""
        self._connection.close()

    def __iter__(self) -> Iterator[MissionOut | ReceivedItem]:
        """Yield what arrives until the mission is over."""
        while True:
            message = self._message()
            if message.get("kind") == "end":
                return
            if message.get("kind") == "mission":
                yield self._mission(message)
            elif message.get("kind") == "item":
                yield self._item(message)

    def _message(self) -> dict[str, Any]:
        text = self._received()
        try:
            message = json.loads(text) if isinstance(text, str) else None
        except (ValueError, RecursionError):
            message = None
        if not isinstance(message, dict):
            raise self._exchange.strange("a message that is no JSON object")
        return message

    def _mission(self, message: dict[str, Any]) -> MissionOut:
        try:
            return MissionOut.model_validate(printed(message.get("mission")))
        except ValidationError as error:
            place = ".".join(map(str, error.errors()[0]["loc"]))
            raise self._exchange.strange(f"the mission's {place}") from None

    def _item(self, message: dict[str, Any]) -> ReceivedItem:
        blob = self._received() if message.get("blob") else b""
        stream, seq = message.get("stream"), message.get("seq")
        if isinstance(blob, str) or not isinstance(stream, str) or not isinstance(seq, int):
            raise self._exchange.strange("an item without its parts")
        return ReceivedItem(stream, seq, message.get("item"), blob)

    def _received(self) -> str | bytes:
        from websockets.exceptions import ConnectionClosed  # noqa: PLC0415 - only to follow

        try:
            return self._connection.recv(_SILENT_SECONDS)
        except TimeoutError:
            text = f"nothing came for {_SILENT_SECONDS:g} s"
            raise self._exchange.unreachable(TimeoutError(text)) from None
        except (ConnectionClosed, OSError, EOFError) as error:
            raise self._exchange.unreachable(error) from None
