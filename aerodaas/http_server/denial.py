"""How requests are refused, WebSockets among them: by an HTTP answer that has the reason.

A WebSocket begins as an HTTP request, and before it is accepted it can be refused as one. A server
that turns the closing of such a socket into an empty 403 would lose the reason.
"""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Iterable, Mapping, MutableMapping, Sequence
from http import HTTPStatus
from typing import Any, TypeAlias

__all__ = ["answer_of", "closing_reason", "deny", "malformed"]

_POLICY_VIOLATION = 1008
_CLOSING_BYTES = 123
"""Bytes of a WebSocket's closing reason (RFC 6455)."""
_ANSWERS = "websocket.http.response"
"""ASGI extension by which a server sends an HTTP answer instead of accepting a WebSocket."""
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
    if scope["type"] == "websocket" and _ANSWERS not in scope.get("extensions", {}):
        reason = closing_reason(content["text"])
        await send({"type": "websocket.close", "code": _POLICY_VIOLATION, "reason": reason})
        return
    kind = _ANSWERS if scope["type"] == "websocket" else "http.response"
    body, headers = _coded(content, more)
    await send({"type": f"{kind}.start", "status": status, "headers": headers})
    await send({"type": f"{kind}.body", "body": body})


def malformed(problems: Sequence[Mapping[str, Any]]) -> tuple[int, str]:
    """Status and text for a request that is not as its schema has it; `problems` are pydantic's.

    Each wrong field and its place, without the input, which may hold NaN or secrets.
    """
    invalid = any(problem["type"] == "json_invalid" for problem in problems)
    status = HTTPStatus.BAD_REQUEST if invalid else HTTPStatus.UNPROCESSABLE_ENTITY
    said = (f"{_place(problem['loc'])}: {problem['msg']}" for problem in problems)
    return int(status), "; ".join(said)


def _place(location: tuple[int | str, ...]) -> str:
    return ".".join(map(str, location[1:])) or str(location[0])


def answer_of(status: HTTPStatus, text: str) -> bytes:
    """The whole HTTP answer that refuses a request, for a server without ASGI."""
    body, headers = _coded({"text": text}, [(b"connection", b"close")])
    lines = [b"HTTP/1.1 %d %s" % (status, status.phrase.encode())]
    lines += [b"%s: %s" % header for header in headers]
    return b"\r\n".join([*lines, b"", body])


def closing_reason(text: str) -> str:
    """A reason as a WebSocket's closing takes it: 123 bytes of UTF-8 at most, in whole letters."""
    coded = text.encode("utf-8", "replace")
    if len(coded) <= _CLOSING_BYTES:
        return coded.decode()
    mark = "…"
    return coded[: _CLOSING_BYTES - len(mark.encode())].decode(errors="ignore") + mark


def _coded(content: Mapping[str, Any], more: Iterable[Header]) -> tuple[bytes, list[Header]]:
    body = json.dumps(content).encode()
    own = [(b"content-type", b"application/json"), (b"content-length", b"%d" % len(body))]
    return body, [*own, *more]
