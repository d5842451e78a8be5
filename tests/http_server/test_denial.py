"""Refusals: one answer for requests and WebSockets, whose reason is not lost."""

from __future__ import annotations

import asyncio
import json
from collections.abc import MutableMapping
from http import HTTPStatus
from typing import Any

import pytest

from aerodaas.http_server.denial import answer_of, deny

LONG = "ä" * 300


def sent(kind: str) -> list[dict[str, Any]]:
    """What a refusal sends."""
    messages: list[dict[str, Any]] = []

    async def send(message: MutableMapping[str, Any]) -> None:
        messages.append(dict(message))

    asyncio.run(deny({"type": kind}, send, 403, {"text": LONG}, pause=3))
    return messages


@pytest.mark.parametrize(
    ("kind", "answer"), [("http", "http.response"), ("websocket", "websocket.http.response")]
)
def test_the_answer_has_the_whole_reason(kind: str, answer: str) -> None:
    """Whatever was asked for, it is one answer, with its status and headers."""
    start, body = sent(kind)
    assert (start["type"], start["status"]) == (f"{answer}.start", 403)
    assert (b"retry-after", b"3") in start["headers"]
    assert (b"content-length", str(len(body["body"])).encode()) in start["headers"]
    assert body["type"] == f"{answer}.body"
    assert json.loads(body["body"]) == {"text": LONG}


def test_only_a_missing_identity_is_asked_for() -> None:
    """A 401 says how to come back; a 403 does not, and names no time unless it has one."""
    messages: list[dict[str, Any]] = []

    async def send(message: MutableMapping[str, Any]) -> None:
        messages.append(dict(message))

    for status in (401, 403):
        asyncio.run(deny({"type": "http"}, send, status, {"text": "no"}))
    asked = [dict(message["headers"]) for message in messages if "headers" in message]
    assert [headers.get(b"www-authenticate") for headers in asked] == [b"Bearer", None]
    assert not any(b"retry-after" in headers for headers in asked)


def test_a_server_of_its_own_answers_alike() -> None:
    """Head, length and JSON."""
    head, _, body = answer_of(HTTPStatus.FORBIDDEN, LONG).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 403 Forbidden\r\n")
    assert f"content-length: {len(body)}".encode() in head.splitlines()
    assert json.loads(body) == {"text": LONG}
