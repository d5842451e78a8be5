"""Who opens the console of one's own flight: two tokens, made for this flight alone."""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from http import HTTPStatus

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Receive, Scope, Send

from aerodaas.analytics.remote.attempts import WrongTokens
from aerodaas.analytics.remote.denial import deny
from aerodaas.analytics.remote.guard import address_of, body_objection
from aerodaas.console.page import is_page
from aerodaas.protocol.schemas import RefusalOut, Role

__all__ = ["SUBPROTOCOL", "FlightKeys", "TokenGuard", "bearer", "role_of"]

SUBPROTOCOL = "aerodaas"
"""What a browser's WebSocket speaks; beside it, its token: a browser sets no further headers."""
_BEARER = "bearer."
_ROLE = "aerodaas.role"
"""Key of the sender's role in a request's ASGI scope."""


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


@dataclass(frozen=True)
class FlightKeys:
    """The tokens of one flight's console: one flies, the other watches."""

    pilot: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)
    viewer: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)

    def role(self, token: str) -> Role | None:
        """The role of a token, compared in constant time; None for a wrong one."""
        given = token.encode()
        flies = hmac.compare_digest(given, self.pilot.encode())
        watches = hmac.compare_digest(given, self.viewer.encode())
        return Role.PILOT if flies else Role.VIEWER if watches else None


def role_of(connection: HTTPConnection) -> Role:
    """The role of a request's sender, whom the guard has let in."""
    role: Role = connection.scope[_ROLE]
    return role


class TokenGuard:
    """ASGI middleware that admits the page's own files, and all else by one of two tokens."""

    def __init__(self, app: ASGIApp, keys: FlightKeys, wrong: WrongTokens) -> None:
        """Protect `app`; `wrong` counts the tokens that are neither."""
        self._app = app
        self._keys = keys
        self._wrong = wrong

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request, or refuse it with the reason."""
        if scope["type"] not in {"http", "websocket"}:
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        role = self._keys.role(bearer(connection.headers))
        status, text = body_objection(dict(scope["headers"]))
        if status:
            await _refuse(scope, send, status, text)
        elif role is not None or is_page(connection):
            scope[_ROLE] = role
            await self._app(scope, receive, send)
        elif pause := self._wrong.count(address_of(scope)):
            text = "too many wrong tokens"
            await _refuse(scope, send, HTTPStatus.TOO_MANY_REQUESTS, text, pause)
        else:
            text = "wrong or missing token: open the console by the address that the flight told"
            await _refuse(scope, send, HTTPStatus.UNAUTHORIZED, text)


async def _refuse(scope: Scope, send: Send, status: int, text: str, pause: int = 0) -> None:
    await deny(scope, send, status, RefusalOut(text=text).model_dump(), pause=pause or None)
