"""Accounts of one's own flight: one for each of its tokens, made for this flight alone."""

from __future__ import annotations

import hmac
import secrets
import threading
from collections.abc import Callable, Mapping

from aerodaas.protocol.schemas import USUAL_SCOPES, AccountOut, Role, Scope
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import RefusedError
from aerodaas.service.http.limits import WrongTokens

__all__ = ["OWN", "REMOTE", "FlightTokens", "account_of", "new_tokens", "principal_of"]

OWN = "own"
"""Id of the mission and of its tenant: there is nobody else's."""


REMOTE = "remote"
"""Account of a remote user."""


def principal_of(account: str, role: Role) -> Principal:
    """Make the account of a token; who watches only may have pictures, and no more.

    Args:
        account: Name of the account.
        role: Its role.
    """
    scopes = frozenset({Scope.SENSE}) if role is Role.VIEWER else frozenset(USUAL_SCOPES)
    return Principal(account=account, tenant=OWN, role=role, scopes=scopes, token=account)


def new_tokens() -> dict[str, Principal]:
    """Make a token for who flies, and one for who watches only."""
    roles = (Role.PILOT, Role.VIEWER)
    return {secrets.token_urlsafe(24): principal_of(role.value, role) for role in roles}


def account_of(principal: Principal) -> AccountOut:
    """The account of a token."""
    return AccountOut(
        name=principal.account,
        tenant=OWN,
        role=principal.role,
        scopes=list(principal.scopes),
        created=0.0,
    )


class FlightTokens:
    """Tokens of one flight; wrong ones are counted and slowed down. Threads may share it."""

    def __init__(
        self,
        tokens: Mapping[str, Principal],
        what: str = "the console",
        remedy: str = "open the console by the address that the flight told",
        anybody: Principal | None = None,
    ) -> None:
        """Admit who has one of `tokens`.

        Args:
            tokens: Tokens, and whose they are.
            what: Name of what they open, for people.
            remedy: Where a token is to be found.
            anybody: Account of all who ask, if they need no token.
        """
        self.alert: Callable[[str], None] = lambda _: None
        """Tells people of many wrong tokens."""
        self._tokens = tokens
        self._wrong = WrongTokens(self._alert, server=what)
        self._remedy = remedy
        self._anybody = anybody
        self._lock = threading.Lock()

    def token(self, role: Role) -> str:
        """The token of an account with this role."""
        return next(token for token, who in self._tokens.items() if who.role is role)

    def of(self, token: str, address: str) -> Principal:
        """Account of a token.

        Args:
            token: As it was sent.
            address: Address of the sender, by which wrong tokens are counted.

        Raises:
            RefusedError: If the token is wrong.
        """
        if self._anybody is not None:
            return self._anybody
        # All of them are compared, each in constant time.
        given = token.encode()
        known = self._tokens.items()
        found = [who for one, who in known if hmac.compare_digest(given, one.encode())]
        if found:
            return found[0]
        with self._lock:
            pause = self._wrong.count(address)
        if pause:
            raise RefusedError(429, "too many wrong tokens", retry_after=pause)
        raise RefusedError(401, f"wrong or missing token: {self._remedy}")

    def _alert(self, text: str) -> None:
        self.alert(text)
