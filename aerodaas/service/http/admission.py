"""Admission of requests: who asks, and whether they may."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from http import HTTPStatus
from typing import TYPE_CHECKING, Protocol

from starlette.requests import HTTPConnection

from aerodaas.errors import AeroDaaSError
from aerodaas.http_server.addresses import address_of
from aerodaas.mission.commands import Answer
from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.access.principal import Principal, require
from aerodaas.service.errors import RefusedError
from aerodaas.service.http.bearer import bearer

if TYPE_CHECKING:
    from aerodaas.service.access.audit import Audit

__all__ = ["Admission", "Tokens"]

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
"""Refusals of who may not go on; any other one is the service's own trouble."""


class Tokens(Protocol):
    """Tokens that are good, and whose they are."""

    def of(self, token: str, address: str) -> Principal:
        """Who sends a `token` from an `address`; raises RefusedError for a wrong one."""
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
        """As `admit`, in this thread; without `count` it is no further request."""
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
    ) -> bool:
        """Whether the sender of a request that lasts still may have it; counts as no further one.

        `look` raises RefusedError for who may not. The service's own trouble refuses nobody.
        """
        token, address = bearer(connection.headers), address_of(connection.scope)
        try:
            connection.scope[_SENDER] = self._tokens.of(token, address)
            look(self.require(connection, role, scope))
        except RefusedError as error:
            return error.status not in _GONE
        except AeroDaaSError:
            # The database may not answer for a while.
            return True
        return True

    def require(
        self, connection: HTTPConnection, role: Role, scope: Scope | None = None
    ) -> Principal:
        """The sender of a request; raises RefusedError if they may not do this."""
        principal: Principal = connection.scope[_SENDER]
        with self.auditing(principal, connection):
            require(principal, role, scope)
        return principal

    @contextmanager
    def auditing(self, principal: Principal, connection: HTTPConnection) -> Iterator[None]:
        """Audit what is refused to the sender of a request meanwhile."""
        try:
            yield
        except RefusedError as error:
            self._refuse(principal, connection, error)
            raise

    def note_answer(self, principal: Principal, action: str, target: str, answer: Answer) -> None:
        """Audit what a drone answered to a command."""
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
