"""The gate before the service: who sends a request, how large it is, and beside how many."""

from __future__ import annotations

import asyncio
from collections import Counter
from http import HTTPStatus

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from aerodaas.errors import AeroDaaSError
from aerodaas.http_server.addresses import address_of
from aerodaas.protocol.schemas import Role
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import RefusedError
from aerodaas.service.http.admission import Admission
from aerodaas.service.http.counters import RateLimiter
from aerodaas.service.http.limits import RequestLimits
from aerodaas.service.http.page import is_page
from aerodaas.service.http.refusals import refuse

__all__ = ["Gate"]

_READING = frozenset({"GET", "HEAD"})


class Gate:
    """ASGI middleware that applies a server's limits to each request, whoever sends it.

    The role comes first: who may only look sends no body. Roles with a reserve are never turned
    away for their number.
    """

    def __init__(self, app: ASGIApp, admission: Admission, limits: RequestLimits) -> None:
        """Protect `app`: by the tokens of `admission`, and by `limits`."""
        self._app = app
        self._limits = limits
        self._admission = admission
        self._rates = RateLimiter(limits)
        self._counts: Counter[tuple[str, str]] = Counter()
        """Requests under way, as `RequestLimits.at_a_time` has them."""

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
            most, large = self._body(connection)
            sender = await self._admission.admit(connection, self._rates.admit)
            writes = scope["type"] == "http" and scope["method"] not in _READING
            if writes and not sender.role.reaches(Role.PILOT):
                await asyncio.to_thread(self._admission.require, connection, Role.PILOT)
            limits: dict[tuple[str, str], int] = {}
            if not sender.role.reaches(self._limits.reserved):
                limits = self._limits.at_a_time(
                    scope["type"], sender.account, address_of(scope), large=large
                )
            for (kind, owner), limit in limits.items():
                if self._counts[kind, owner] >= limit:
                    text = f"{limit} {kind} of {owner or 'all users'} are answered: wait for one"
                    await asyncio.to_thread(self._turn_away, sender, connection, text)
        except AeroDaaSError as error:
            await refuse(scope, send, error)
            return
        self._counts.update(limits.keys())
        try:
            await self._app(scope, _Bounded(receive, most), send)
        finally:
            self._counts -= Counter(limits.keys())

    def _turn_away(self, sender: Principal, connection: HTTPConnection, text: str) -> None:
        with self._admission.auditing(sender, connection):
            raise RefusedError(int(HTTPStatus.TOO_MANY_REQUESTS), text, retry_after=1.0)

    def _body(self, connection: HTTPConnection) -> tuple[int, bool]:
        """Bytes that a request's body may have, and whether it is large; raises RefusedError."""
        most = self._limits.body_bytes(connection.scope["path"])
        length = connection.headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > most:
            status = int(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
            raise RefusedError(status, f"a body has at most {most} bytes")
        hidden = "transfer-encoding" in connection.headers
        return most, hidden or int(length) > self._limits.large_bytes


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
