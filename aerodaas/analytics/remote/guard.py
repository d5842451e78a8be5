"""Access control of the remote control, applied before a request's body is read."""

from __future__ import annotations

import hmac
import ipaddress
import json
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, TypeAlias

__all__ = ["Guard", "is_loopback"]

Scope: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send: TypeAlias = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App: TypeAlias = Callable[[Scope, Receive, Send], Awaitable[None]]

_MOST_BYTES = 1_000_000
_POLICY_VIOLATION = 1008


def is_loopback(host: str) -> bool:
    """Whether a listening address is reachable from this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class Guard:
    """ASGI middleware that admits requests with the token and a bounded size.

    Without a token, which is for loopback only, local programs are admitted but web pages are
    not: a browser sends the page's origin, or a host name other than this machine's.
    """

    def __init__(self, app: App, token: str | None) -> None:
        """Protect `app` with `token`."""
        self._app = app
        self._token = None if token is None else token.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request, or refuse it with the reason."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        status, text = self._objection(headers)
        if not status:
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": _POLICY_VIOLATION, "reason": text})
        else:
            await _refuse(send, status, text)

    def _objection(self, headers: dict[bytes, bytes]) -> tuple[int, str]:
        if self._token is not None:
            scheme, _, given = headers.get(b"authorization", b"").partition(b" ")
            if scheme.lower() != b"bearer" or not hmac.compare_digest(given.strip(), self._token):
                return 401, "wrong or missing token: send it as `Authorization: Bearer …`"
        elif b"origin" in headers or not _names_this_machine(headers.get(b"host", b"")):
            text = "without a token only programs of this machine may command: set remote.token"
            return 403, text
        if headers.get(b"transfer-encoding"):
            return 411, "say how long the body is (Content-Length)"
        length = headers.get(b"content-length", b"0")
        if not length.isdigit() or int(length) > _MOST_BYTES:
            return 413, f"a body has at most {_MOST_BYTES} bytes"
        return 0, ""


def _names_this_machine(host: bytes) -> bool:
    name = host.decode("latin-1")
    name = name.partition("]")[0].lstrip("[") if name.startswith("[") else name.partition(":")[0]
    return is_loopback(name)


async def _refuse(send: Send, status: int, text: str) -> None:
    body = json.dumps({"accepted": False, "text": text, "refused": {}}).encode()
    headers = [(b"content-type", b"application/json"), (b"content-length", b"%d" % len(body))]
    if status == 401:  # noqa: PLR2004 - HTTP's own number
        headers.append((b"www-authenticate", b"Bearer"))
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
