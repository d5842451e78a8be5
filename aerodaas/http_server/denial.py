"""How requests are refused, WebSockets among them: by an HTTP answer that has the reason.

A WebSocket begins as an HTTP request, and before it is accepted it is refused as one: its closing
would become an empty 403, without the reason.
"""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Iterable, Mapping, MutableMapping
from http import HTTPStatus
from typing import Any, TypeAlias

__all__ = ["answer_of", "deny"]

_ANSWERS = "websocket.http.response"
"""ASGI extension by which our servers send an HTTP answer instead of accepting a WebSocket."""
Header: TypeAlias = tuple[bytes, bytes]
Send: TypeAlias = Callable[[MutableMapping[str, Any]], Awaitable[None]]


async def deny(
    scope: Mapping[str, Any],
    send: Send,
    status: int,
    content: Mapping[str, Any],
    *,
    pause: int | None = None,
) -> None:
    """Refuse a request, or a WebSocket that is not accepted yet.

    Args:
        scope: Of the request, as ASGI has it.
        send: As ASGI has it.
        status: HTTP status.
        content: The answer's JSON, whose `text` is the reason.
        pause: Seconds after which the same request may succeed; None if it never will.
    """
    more = [(b"www-authenticate", b"Bearer")] if status == HTTPStatus.UNAUTHORIZED else []
    if pause is not None:
        more.append((b"retry-after", b"%d" % pause))
    kind = _ANSWERS if scope["type"] == "websocket" else "http.response"
    body, headers = _coded(content, more)
    await send({"type": f"{kind}.start", "status": status, "headers": headers})
    await send({"type": f"{kind}.body", "body": body})


def answer_of(status: HTTPStatus, text: str) -> bytes:
    """The whole HTTP answer that refuses a request, for a server without ASGI."""
    body, headers = _coded({"text": text}, [(b"connection", b"close")])
    lines = [b"HTTP/1.1 %d %s" % (status, status.phrase.encode())]
    lines += [b"%s: %s" % header for header in headers]
    return b"\r\n".join([*lines, b"", body])


def _coded(content: Mapping[str, Any], more: Iterable[Header]) -> tuple[bytes, list[Header]]:
    body = json.dumps(content).encode()
    own = [(b"content-type", b"application/json"), (b"content-length", b"%d" % len(body))]
    return body, [*own, *more]
