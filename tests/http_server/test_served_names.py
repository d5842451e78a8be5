"""Foreign names at a server's door."""

from __future__ import annotations

import asyncio
from collections.abc import MutableMapping
from typing import Any

import pytest

from aerodaas.http_server.addresses import HostGuard, Receive, Scope, Send, is_served


async def _reached(_scope: Scope, _receive: Receive, send: Send) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": []})


def _ask(app: HostGuard, peer: str = "10.0.0.9", **headers: str) -> tuple[int, dict[bytes, bytes]]:
    sent: list[dict[str, Any]] = []

    async def receive() -> MutableMapping[str, Any]:
        raise AssertionError("the body was read")

    async def send(message: MutableMapping[str, Any]) -> None:
        sent.append(dict(message))

    pairs = [(name.encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": "http", "headers": pairs, "client": (peer, 1)}
    asyncio.run(app(scope, receive, send))
    return sent[0]["status"], dict(sent[0]["headers"])


@pytest.mark.parametrize(
    ("host", "origin", "status"),
    [
        ("127.0.0.1:8360", None, 200),
        ("localhost:8360", "http://localhost:8360", 200),
        ("rebound.example:8360", None, 403),
        ("localhost:8360", "http://evil.example", 403),
        ("localhost:8360", "null", 403),
        ("", None, 403),
    ],
)
def test_the_page_is_served_under_its_own_names(host: str, origin: str | None, status: int) -> None:
    """A stranger's name that resolves to this machine is refused, and another page's script."""
    headers = {"host": host} | ({} if origin is None else {"origin": origin})
    assert _ask(HostGuard(_reached, "127.0.0.1"), **headers)[0] == status


def test_names_where_every_interface_is_listened_on() -> None:
    """Numeric addresses cannot be rebound."""
    assert is_served("192.168.1.5", "::")
    assert not is_served("192.168.1.5", "127.0.0.1")
    assert not is_served("evil.example", "::")
    assert is_served("drone.lan", "drone.lan")
