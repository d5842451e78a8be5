"""The gate before the service: bounds of a request's body, before anything reads it."""

from __future__ import annotations

import json
from http import HTTPStatus

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from aerodaas.service.models import LARGEST_MODEL

__all__ = ["Gate"]

_LARGEST_BODY = 4 << 20
"""Bytes of a JSON body: a document of 10,000 waypoints has 2 MB."""


class Gate:
    """ASGI middleware that refuses bodies that are too large, however they are sent."""

    def __init__(self, app: ASGIApp) -> None:
        """Protect `app`."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        most = LARGEST_MODEL if scope["path"].startswith("/v1/models/") else _LARGEST_BODY
        length = dict(scope["headers"]).get(b"content-length", b"0")
        if not length.isdigit() or int(length) > most:
            await _refuse(send, most)
            return
        await self._app(scope, _Bounded(receive, most), send)


class _Bounded:
    """Reads a body of at most so many bytes; one that goes on ends as a broken connection does."""

    def __init__(self, receive: Receive, most: int) -> None:
        self._receive = receive
        self._left = most

    async def __call__(self) -> Message:
        message = await self._receive()
        if message["type"] == "http.request":
            self._left -= len(message.get("body", b""))
            if self._left < 0:
                return {"type": "http.disconnect"}
        return message


async def _refuse(send: Send, most: int) -> None:
    body = json.dumps({"text": f"a body has at most {most} bytes"}).encode()
    headers = [(b"content-type", b"application/json"), (b"content-length", b"%d" % len(body))]
    status = int(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
