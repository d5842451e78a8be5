"""The gate before the API: the sender of each request, its role, and the limits of both."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from http import HTTPStatus
from typing import TYPE_CHECKING, Protocol

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Send
from starlette.types import Scope as Connection

from aerodaas.errors import AeroDaaSError
from aerodaas.http_server.addresses import address_of
from aerodaas.mission.commands import Answer
from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.access.principal import Principal, require
from aerodaas.service.errors import RefusedError
from aerodaas.service.http.limits import AGENTS_PATH, RateLimiter, RequestLimits
from aerodaas.service.http.page import PAGE_PATHS
from aerodaas.service.http.refusals import refuse

if TYPE_CHECKING:
    from aerodaas.service.access.audit import Audit

__all__ = ["SUBPROTOCOL", "Admission", "LimitsMiddleware", "Tokens", "bearer"]

SUBPROTOCOL = "aerodaas"
"""Subprotocol of a browser's WebSocket, beside its token: a browser sets no further headers."""
_BEARER = "bearer."


def bearer(headers: Mapping[str, str]) -> str:
    """The token that a request carries, empty for none.

    In `Authorization: Bearer TOKEN`; or, of a browser's WebSocket, as the subprotocol
    `bearer.TOKEN` beside `aerodaas`, which is the one that is answered.
    """
    kind, _, token = headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer":
        return token.strip()
    offered = [one.strip() for one in headers.get("sec-websocket-protocol", "").split(",")]
    if SUBPROTOCOL not in offered:
        return ""
    return next((one[len(_BEARER) :] for one in offered if one.startswith(_BEARER)), "")


_SENDER = "aerodaas.principal"
"""Key of the sender in a request's ASGI scope."""
_THREADS = 8
_GONE = frozenset(
    {
        HTTPStatus.UNAUTHORIZED,
        HTTPStatus.FORBIDDEN,
        HTTPStatus.NOT_FOUND,
        # Of many wrong tokens from the same address; the right one is never told so.
        HTTPStatus.TOO_MANY_REQUESTS,
    }
)
"""Refusals of who may not go on; any other one is the service's own errors."""


class Tokens(Protocol):
    """Tokens that are good, and whose they are."""

    def of(self, token: str, address: str) -> Principal:
        """Account of a token.

        Args:
            token: As it was sent.
            address: Address of the sender.

        Raises:
            RefusedError: If the token is wrong.
        """
        ...


class Admission:
    """Tells who sends a request, and whether they may; refusals are audited."""

    def __init__(self, tokens: Tokens, audit: Audit | None = None) -> None:
        """Admit by `tokens`.

        Args:
            tokens: Tokens that are good.
            audit: Log of refusals and of drones' answers; None for none.
        """
        self._audit = audit
        self._tokens = tokens
        self._threads = ThreadPoolExecutor(_THREADS, "admission")

    async def admit(self, connection: HTTPConnection, count: Callable[[str], None]) -> Principal:
        """Identify the sender of a request before its body is read.

        A thread of this alone does it: nobody's other work keeps a sender waiting. Without a
        database that has the tokens, and the audit, it is done at once.

        Args:
            connection: The request.
            count: Counts a request of an account; raises RefusedError for one too many.

        Returns:
            The sender.

        Raises:
            RefusedError: For a wrong token, and from `count`.
        """
        if self._audit is None:
            return self.identify(connection, count)
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._threads, self.identify, connection, count)

    def identify(
        self, connection: HTTPConnection, count: Callable[[str], None] = lambda _: None
    ) -> Principal:
        """As `admit`, in this thread.

        Args:
            connection: The request.
            count: Counts a request of the account; by default it is no further request.
        """
        address = address_of(connection.scope)
        principal: Principal | None = None
        try:
            principal = self._tokens.of(bearer(connection.headers), address)
            count(principal.account)
        except RefusedError as error:
            # A wrong token is audited where it is counted.
            if principal is not None:
                self._refuse(principal, connection, error)
            raise
        connection.scope[_SENDER] = principal
        return principal

    def stays(
        self,
        connection: HTTPConnection,
        role: Role,
        scope: Scope | None,
        look: Callable[[Principal], object],
        *,
        agents: bool = False,
    ) -> bool:
        """Whether the sender of a request that lasts still may have it; counts as no further one.

        An error of the service's own refuses nobody.

        Args:
            connection: The request.
            role: Least role that it needs.
            scope: Scope that it needs; None for none.
            look: Raises RefusedError for who may not.
            agents: Whether agents may, too.
        """
        token, address = bearer(connection.headers), address_of(connection.scope)
        try:
            connection.scope[_SENDER] = self._tokens.of(token, address)
            look(self.require(connection, role, scope, agents=agents))
        except RefusedError as error:
            return error.status not in _GONE
        except AeroDaaSError:
            # The database may not answer for a while.
            return True
        return True

    def require(
        self,
        connection: HTTPConnection,
        role: Role,
        scope: Scope | None = None,
        *,
        agents: bool = False,
    ) -> Principal:
        """The sender of a request.

        Args:
            connection: The request.
            role: Least role that it needs.
            scope: Scope that it needs; None for none.
            agents: Whether agents may, too; a route that does not say so refuses them.

        Raises:
            RefusedError: If the sender may not do this.
        """
        principal: Principal = connection.scope[_SENDER]
        with self.auditing(principal, connection):
            require(principal, role, scope, agents=agents)
        return principal

    @contextmanager
    def auditing(self, principal: Principal, connection: HTTPConnection) -> Iterator[None]:
        """Audit what is refused to the sender of a request meanwhile.

        Args:
            principal: The sender.
            connection: The request.
        """
        try:
            yield
        except RefusedError as error:
            self._refuse(principal, connection, error)
            raise

    def note_answer(self, principal: Principal, action: str, target: str, answer: Answer) -> None:
        """Audit what a drone answered to a command.

        Args:
            principal: The account that gave the command.
            action: Name of the command.
            target: What it was given to.
            answer: What the drone said.
        """
        if self._audit is not None:
            self._audit.note_answer(principal, action, target, answer)

    def _refuse(
        self, principal: Principal, connection: HTTPConnection, error: RefusedError
    ) -> None:
        if self._audit is None:
            return
        action = f"{connection.scope.get('method', 'WS')} {connection.scope['path']}"
        self._audit.write(
            principal,
            action,
            text=str(error),
            accepted=False,
            address=address_of(connection.scope),
            required=False,
        )


_READING = frozenset({"GET", "HEAD"})


class LimitsMiddleware:
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

    async def __call__(self, scope: Connection, receive: Receive, send: Send) -> None:
        """Forward a request, or refuse it."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        if scope["type"] == "http" and scope["path"] in PAGE_PATHS:
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
                kind = "agents" if scope["path"] == AGENTS_PATH else scope["type"]
                limits = self._limits.at_a_time(
                    kind, sender.account, address_of(scope), large=large
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
