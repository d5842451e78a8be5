"""The guard of the remote control: `Bearer` and the token, or nothing."""

from __future__ import annotations

import asyncio
from collections.abc import MutableMapping
from typing import Any

import pytest

from aerodaas.http_server.addresses import Guard, Receive, Scope, Send

TOKEN = "correct-horse-battery"  # noqa: S105 - this test's own


def _ask(kind: str, headers: list[tuple[bytes, bytes]]) -> tuple[bool, list[dict[str, Any]]]:
    """Whether the application behind the guard was reached, and what the guard itself sent."""
    reached: list[str] = []
    sent: list[dict[str, Any]] = []

    async def app(scope: Scope, _receive: Receive, _send: Send) -> None:
        reached.append(scope["type"])

    async def receive() -> MutableMapping[str, Any]:
        raise AssertionError("the body was read")

    async def send(message: MutableMapping[str, Any]) -> None:
        sent.append(dict(message))

    asyncio.run(Guard(app, TOKEN)({"type": kind, "headers": headers}, receive, send))
    return bool(reached), sent


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("scheme", ["Basic", "Token", "Bearer2", "Bear", "Digest", "", None])
def test_another_scheme_is_refused(kind: str, scheme: str | None) -> None:
    """The right token behind the wrong word, or behind none, is no authorisation."""
    given = TOKEN if scheme is None else f"{scheme} {TOKEN}"
    reached, sent = _ask(kind, [(b"authorization", given.encode())])
    assert not reached
    assert sent[0].get("status", sent[0].get("code")) in {401, 1008}
    if kind == "http":
        assert (b"www-authenticate", b"Bearer") in sent[0]["headers"]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("scheme", ["Bearer", "bearer", "BEARER"])
def test_the_scheme_is_let_in(kind: str, scheme: str) -> None:
    """In any case of letters, as HTTP has it."""
    assert _ask(kind, [(b"authorization", f"{scheme} {TOKEN}".encode())]) == (True, [])
