"""The gate before the service: who sends a request, how large it is, and beside how many."""

from __future__ import annotations

import asyncio
from collections import Counter
from dataclasses import dataclass
from http import HTTPStatus

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from aerodaas.errors import AeroDaaSError
from aerodaas.http_server.addresses import address_of
from aerodaas.protocol.schemas import Role
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import RefusedError
from aerodaas.service.http.admission import Admission
from aerodaas.service.http.page import is_page
from aerodaas.service.http.refusals import refuse
from aerodaas.service.models import LARGEST_MODEL

__all__ = ["Bounds", "Gate"]

_LARGEST_DOCUMENT, _LARGEST_COMMAND, _LARGEST_OTHER = 4 << 20, 1 << 20, 16 << 10
"""Bytes of a submission, of what is asked of a mission, and of any other body: a document of 10,000
waypoints has 2 MB, a command of 1,000 a quarter."""
_LARGE = 64 << 10
"""Bytes of a body of which an account sends few at once."""
_MOST_AT_ONCE, _MOST_LARGE = 16, 2
"""Requests of one account that are answered at once, and those of them with a large body: who asks
for more keeps others' commands waiting."""
_MOST_LASTING_OF_ADDRESS = 160
_MOST_OF_ALL, _MOST_LARGE_OF_ALL, _MOST_LASTING_OF_ALL = 160, 16, 320
"""The same of all accounts but those with a reserve: threads and connections are left for these."""
_READING = frozenset({"GET", "HEAD"})


@dataclass(frozen=True)
class Bounds:
    """Bounds of who may ask how much at once."""

    reserved: Role = Role.OPERATOR
    """The lowest role whose requests are never turned away for their number."""
    lasting: int = 32
    """Most live views and other WebSockets of one account."""


class Gate:
    """ASGI middleware that admits valid tokens only, bodies of a bounded size, and few at once.

    The role comes first: who may only look sends no body. Who has a reserve is never turned
    away.
    """

    def __init__(self, app: ASGIApp, admission: Admission, bounds: Bounds) -> None:
        """Protect `app`."""
        self._app = app
        self._bounds = bounds
        self._admission = admission
        self._counts: Counter[tuple[str, str]] = Counter()
        """What is answered now, by kind and account or address; "" for all without a reserve."""

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
            most, large = _bound_of(connection)
            sender = await self._admission.admit(connection)
            writes = scope["type"] == "http" and scope["method"] not in _READING
            if writes and not sender.role.reaches(Role.PILOT):
                await asyncio.to_thread(self._admission.require, connection, Role.PILOT)
            bounds = self._bounds_of(sender, connection, large=large)
            for (kind, whose), limit in bounds.items():
                if self._counts[kind, whose] >= limit:
                    text = f"{limit} {kind} of {whose or 'all users'} are answered: wait for one"
                    await asyncio.to_thread(self._turn_away, sender, connection, text)
        except AeroDaaSError as error:
            await refuse(scope, send, error)
            return
        self._counts.update(bounds.keys())
        try:
            await self._app(scope, _Bounded(receive, most), send)
        finally:
            self._counts -= Counter(bounds.keys())

    def _turn_away(self, sender: Principal, connection: HTTPConnection, text: str) -> None:
        with self._admission.auditing(sender, connection):
            raise RefusedError(int(HTTPStatus.TOO_MANY_REQUESTS), text, retry_after=1.0)

    def _bounds_of(
        self, sender: Principal, connection: HTTPConnection, *, large: bool
    ) -> dict[tuple[str, str], int]:
        """What a request counts as, by kind and whose it is, with the most of each."""
        if sender.role.reaches(self._bounds.reserved):
            return {}
        if connection.scope["type"] == "websocket":
            return {
                ("live views", sender.account): self._bounds.lasting,
                ("live views", address_of(connection.scope)): _MOST_LASTING_OF_ADDRESS,
                ("live views", ""): _MOST_LASTING_OF_ALL,
            }
        bounds = {("requests", sender.account): _MOST_AT_ONCE, ("requests", ""): _MOST_OF_ALL}
        if large:
            bounds["large requests", sender.account] = _MOST_LARGE
            bounds["large requests", ""] = _MOST_LARGE_OF_ALL
        return bounds


def _bound_of(connection: HTTPConnection) -> tuple[int, bool]:
    """Most bytes of a request's body, and whether it is large; raises RefusedError beyond them."""
    path = connection.scope["path"]
    most = _LARGEST_OTHER
    if path == "/v1/missions":
        most = _LARGEST_DOCUMENT
    elif path.startswith("/v1/missions/"):
        most = _LARGEST_COMMAND
    elif path.startswith("/v1/models/"):
        most = LARGEST_MODEL
    length = connection.headers.get("content-length", "0")
    if not length.isdecimal() or int(length) > most:
        status = int(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
        raise RefusedError(status, f"a body has at most {most} bytes")
    hidden = "transfer-encoding" in connection.headers
    return most, hidden or int(length) > _LARGE


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
