"""Names and addresses of a server: who may address it by which."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from http import HTTPStatus
from typing import Any, TypeAlias

from aerodaas.http_server.denial import deny

__all__ = [
    "HostGuard",
    "address_of",
    "host_name",
    "is_loopback",
    "is_served",
    "listen",
]

Scope: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send: TypeAlias = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App: TypeAlias = Callable[[Scope, Receive, Send], Awaitable[None]]


def is_loopback(host: str) -> bool:
    """Whether a listening address is reachable from this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class HostGuard:
    """ASGI middleware that admits browsers only at the names under which a page is served.

    A page of a stranger's name that resolves to this machine (DNS rebinding) sends that name as
    its host, and a request of another page's script that page as its origin.
    """

    def __init__(self, app: App, served: str, *, pages: bool = True) -> None:
        """Protect `app`, served at the host `served`; without `pages`, from every web page."""
        self._app = app
        self._served = served
        self._pages = pages

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request, or refuse it with the reason."""
        if scope["type"] in {"http", "websocket"}:
            headers = dict(scope["headers"])
            host, origin = headers.get(b"host", b""), headers.get(b"origin")
            same = self._pages and origin is not None and origin.partition(b"://")[2] == host
            if (origin is not None and not same) or not is_served(host_name(host), self._served):
                text = "this page is served under other names only: open it by the address told"
                if not self._pages:
                    text = "without a token only programs of this machine may: set remote.token"
                await deny(scope, send, HTTPStatus.FORBIDDEN, {"text": text})
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


def listen(host: str, port: int) -> socket.socket:
    """Listen on a TCP port of IPv4 or IPv6, 0 for any free one; raises OSError, OverflowError."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family)
