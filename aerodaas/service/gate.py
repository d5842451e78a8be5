"""The gate before the service: who sends a request, how large it is, and beside how many."""

from __future__ import annotations

import asyncio
from collections import Counter
from http import HTTPStatus

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from aerodaas.console.page import is_page
from aerodaas.protocol.schemas import Role
from aerodaas.service.access import Principal
from aerodaas.service.errors import RefusedError
from aerodaas.service.models import LARGEST_MODEL
from aerodaas.service.routes.admission import Admission
from aerodaas.service.routes.refusals import refuse
from aerodaas.types.errors import AeroDaaSError

__all__ = ["Gate"]

_LARGEST_BODY = 4 << 20
"""Bytes of a JSON body: a document of 10,000 waypoints has 2 MB."""
_MOST_AT_ONCE = 16
"""Requests of one account that are answered at once, less than the threads that answer: who asks
for more, and for what takes long, would keep others' commands waiting."""


class Gate:
    """ASGI middleware that admits valid tokens only, bodies of a bounded size, and few at once."""

    def __init__(self, app: ASGIApp, admission: Admission) -> None:
        """Protect `app`."""
        self._app = app
        self._admission = admission
        self._answered: Counter[str] = Counter()
        """Requests that are being answered, by account."""

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
            sender = await asyncio.to_thread(self._admission.enter, connection)
            # A WebSocket that lasts is none that others wait for; an operator is never turned away.
            counts = scope["type"] == "http" and not sender.role.reaches(Role.OPERATOR)
            if counts and self._answered[sender.account] >= _MOST_AT_ONCE:
                await asyncio.to_thread(self._turn_away, sender, connection)
        except AeroDaaSError as error:
            await refuse(scope, send, error)
            return
        count = Counter([sender.account] if counts else [])
        self._answered += count
        try:
            await self._app(scope, _Bounded(receive, most), send)
        finally:
            self._answered -= count

    def _turn_away(self, sender: Principal, connection: HTTPConnection) -> None:
        status = int(HTTPStatus.TOO_MANY_REQUESTS)
        text = f"{_MOST_AT_ONCE} requests of {sender.account} are being answered: wait for one"
        with self._admission.auditing(sender, connection):
            raise RefusedError(status, text, retry_after=1.0)


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
