"""Access control of the remote control, applied before a request's body is read."""

from __future__ import annotations

import hmac
import ipaddress
import socket
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from http import HTTPStatus
from typing import Any, TypeAlias

from aerodaas.http_server.denial import deny
from aerodaas.http_server.wrong_tokens import WrongTokens

__all__ = [
    "Guard",
    "HostGuard",
    "address_of",
    "body_objection",
    "host_name",
    "is_loopback",
    "is_served",
    "listen",
]

Scope: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send: TypeAlias = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App: TypeAlias = Callable[[Scope, Receive, Send], Awaitable[None]]

_MOST_BYTES = 1_000_000


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

    def __init__(
        self, app: App, token: str | None, tell: Callable[[str], None] = lambda _: None
    ) -> None:
        """Protect `app` with `token`; `tell` tells people of many wrong ones."""
        self._app = app
        self._token = None if token is None else token.encode()
        self._wrong = WrongTokens(tell)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request, or refuse it with the reason."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        status, text = self._objection(headers)
        pause = self._wrong.count(address_of(scope)) if status == HTTPStatus.UNAUTHORIZED else 0
        if pause:
            status, text = HTTPStatus.TOO_MANY_REQUESTS, "too many wrong tokens"
        if not status:
            await self._app(scope, receive, send)
        else:
            await _refuse(scope, send, status, text, pause)

    def _objection(self, headers: dict[bytes, bytes]) -> tuple[int, str]:
        if self._token is not None:
            scheme, _, given = headers.get(b"authorization", b"").partition(b" ")
            if scheme.lower() != b"bearer" or not hmac.compare_digest(given.strip(), self._token):
                return 401, "wrong or missing token: send it as `Authorization: Bearer …`"
        elif b"origin" in headers or not is_loopback(host_name(headers.get(b"host", b""))):
            text = "without a token only programs of this machine may command: set remote.token"
            return 403, text
        return body_objection(headers)


def body_objection(headers: Mapping[bytes, bytes]) -> tuple[int, str]:
    """Status and reason against reading a request's body, by its headers; 0 without any."""
    if headers.get(b"transfer-encoding"):
        return 411, "say how long the body is (Content-Length)"
    length = headers.get(b"content-length", b"0")
    if not length.isdigit() or int(length) > _MOST_BYTES:
        return 413, f"a body has at most {_MOST_BYTES} bytes"
    return 0, ""


class HostGuard:
    """ASGI middleware that admits browsers only at the names under which a page is served.

    A page of a stranger's name that resolves to this machine (DNS rebinding) sends that name as
    its host, and a request of another page's script that page as its origin.
    """

    def __init__(self, app: App, served: str) -> None:
        """Protect `app`, served at the host `served`."""
        self._app = app
        self._served = served

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request, or refuse it with the reason."""
        if scope["type"] in {"http", "websocket"}:
            headers = dict(scope["headers"])
            host, origin = headers.get(b"host", b""), headers.get(b"origin")
            same = origin is None or origin.partition(b"://")[2] == host
            if not same or not is_served(host_name(host), self._served):
                text = "this page is served under other names only: open it by the address told"
                await _refuse(scope, send, HTTPStatus.FORBIDDEN, text)
                return
        await self._app(scope, receive, send)


def is_served(name: str, served: str) -> bool:
    """Whether what is served at the host `served` may be addressed by `name`.

    By the loopback names, by `served` itself, and, where every interface is listened on, by any
    numeric address and by this machine's own name: none of these can be a stranger's name.
    """
    name = name.lower().rstrip(".")
    if is_loopback(name) or name == served.strip("[]").lower():
        return True
    if served.strip("[]") not in {"0.0.0.0", "::", ""}:  # noqa: S104 - compared, not bound
        return False
    own = socket.gethostname().lower()
    return _is_numeric(name) or name in {own, own.partition(".")[0], f"{own}.local"}


def _is_numeric(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def address_of(scope: Scope) -> str:
    """From which a request comes, without its port."""
    client = scope.get("client")
    return str(client[0]) if client else "an unknown address"


def host_name(host: bytes) -> str:
    """The name in a `Host` header, without its port."""
    name = host.decode("latin-1")
    return name.partition("]")[0].lstrip("[") if name.startswith("[") else name.partition(":")[0]


async def _refuse(scope: Scope, send: Send, status: int, text: str, pause: int = 0) -> None:
    content = {"accepted": False, "text": text, "refused": {}}
    await deny(scope, send, status, content, pause=pause or None)


def listen(host: str, port: int) -> socket.socket:
    """Listen on a TCP port of IPv4 or IPv6, 0 for any free one; raises OSError, OverflowError."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family)
