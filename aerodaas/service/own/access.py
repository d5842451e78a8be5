"""Accounts of one's own flight: one for each of its tokens, made for this flight alone."""

from __future__ import annotations

import hmac
import secrets
import threading
from collections.abc import Callable, Mapping

from aerodaas.http_server.wrong_tokens import WrongTokens
from aerodaas.protocol.schemas import AccountOut, Role, Scope
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import RefusedError

__all__ = ["OWN", "FlightTokens", "account_of", "new_tokens"]

OWN = "own"
"""Id of the mission and of its tenant: there is nobody else's."""


def new_tokens() -> dict[str, Role]:
    """Make a token for who flies, and one for who watches only."""
    return {secrets.token_urlsafe(24): role for role in (Role.PILOT, Role.VIEWER)}


def account_of(principal: Principal) -> AccountOut:
    """The account of a token."""
    return AccountOut(
        name=principal.account,
        tenant=OWN,
        role=principal.role,
        scopes=sorted(principal.scopes, key=list(Scope).index),
        created=0.0,
    )


class FlightTokens:
    """Tokens of one flight; wrong ones are counted and slowed down. Threads may share it."""

    def __init__(
        self, tokens: Mapping[str, Role], tell: Callable[[str], None], what: str = "the console"
    ) -> None:
        """Admit `tokens` with a role each; `tell` people of many wrong ones at `what`."""
        self._tokens = tokens
        self._wrong = WrongTokens(tell, what=what)
        self._lock = threading.Lock()

    def of(self, token: str, address: str) -> Principal:
        """Who sends a token; raises RefusedError for a wrong one, from an `address`."""
        # All of them are compared, each in constant time.
        given = token.encode()
        found = [
            role
            for known, role in self._tokens.items()
            if hmac.compare_digest(given, known.encode())
        ]
        if found:
            return _principal(found[0])
        with self._lock:
            pause = self._wrong.count(address)
        if pause:
            raise RefusedError(429, "too many wrong tokens", retry_after=pause)
        raise RefusedError(
            401, "wrong or missing token: open the console by the address that the flight told"
        )


def _principal(role: Role) -> Principal:
    scopes = frozenset({Scope.SENSE}) if role is Role.VIEWER else frozenset(Scope)
    return Principal(account=role.value, tenant=OWN, role=role, scopes=scopes, token=role.value)
