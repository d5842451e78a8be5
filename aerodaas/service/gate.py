"""The gate before the service: who sends a request, and how large it is, before it is read."""

from __future__ import annotations

import asyncio
from http import HTTPStatus

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from aerodaas.console.page import is_page
from aerodaas.service.errors import RefusedError
from aerodaas.service.models import LARGEST_MODEL
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.refusals import refuse
from aerodaas.types.errors import AeroDaaSError

__all__ = ["Gate"]

_LARGEST_BODY = 4 << 20
"""Bytes of a JSON body: a document of 10,000 waypoints has 2 MB."""


class Gate:
    """ASGI middleware that admits valid tokens only, and bodies of a bounded size."""

    def __init__(self, app: ASGIApp, admission: Admission) -> None:
        """Protect `app`."""
        self._app = app
        self._admission = admission

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request, or refuse it."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        if is_page(connection):
            await self._app(scope, _Bounded(receive, 0), send)
            return
        try:
            most = _bound_of(connection)
            await asyncio.to_thread(self._admission.enter, connection)
        except AeroDaaSError as error:
            await refuse(scope, send, error)
            return
        await self._app(scope, _Bounded(receive, most), send)


def _bound_of(connection: HTTPConnection) -> int:
    """Most bytes of a request's body; raises RefusedError for one that says it has more."""
    model = connection.scope["path"].startswith("/v1/models/")
    most = LARGEST_MODEL if model else _LARGEST_BODY
    length = connection.headers.get("content-length", "0")
    if not length.isdecimal() or int(length) > most:
        status = int(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
        raise RefusedError(status, f"a body has at most {most} bytes")
    return most


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
