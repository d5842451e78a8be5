"""From a token to who sends the request."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from http import HTTPStatus

from aerodaas.protocol.schemas import Scope
from aerodaas.service.access.accounts import Accounts
from aerodaas.service.access.audit import Audit
from aerodaas.service.access.oidc import OidcVerifier
from aerodaas.service.access.principal import Principal
from aerodaas.service.access.tokens import digest_of, fits, parse
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.service.http.counters import WrongTokens
from aerodaas.service.store import Store
from aerodaas.service.store.rows import Account, Token

__all__ = ["Access"]

_NO_SECRET = "0" * 64
_REMEMBERED = 600.0
"""Seconds for which a token is known while the database does not answer."""
_MOST_REMEMBERED = 1000
_RELEASED = 1_704_067_200.0
"""2024 in Unix seconds: before it there was no release, so a clock that shows it is not set."""


class Access:
    """Tells who sends a request by its token; wrong tokens are counted, slowed and audited.

    The right token is never refused for the wrong ones of others behind the same address. While
    the database does not answer, a token that was right in the last ten minutes, and whose account
    has not changed since, stays so, for its drones must still obey. Threads may share it.
    """

    def __init__(
        self,
        store: Store,
        audit: Audit,
        tell: Callable[[str], None] = lambda _: None,
        clock: Callable[[], float] = time.time,
        issuer: OidcVerifier | None = None,
    ) -> None:
        """Look tokens up in `store`; `tell` people of many wrong ones; times are Unix time.

        With an `issuer`, its tokens are good beside the store's.
        """
        self._issuer = issuer
        self._accounts = Accounts(store, clock)
        self._store = store
        self._audit = audit
        self._clock = clock
        self._lock = threading.Lock()
        self._wrong = WrongTokens(tell, server="service")
        self._known: OrderedDict[str, tuple[Principal, float]] = OrderedDict()

    def of(self, token: str, address: str) -> Principal:
        """Who sends a request.

        Args:
            token: What followed `Bearer` in its header; empty for none.
            address: Where it comes from.

        Raises:
            RefusedError: With status 401 for a token that is missing, malformed, unknown, wrong,
                expired or revoked, or whose account is disabled; all with the same text. With
                403 for an issuer's without tenant or role. With 429 and `retry_after` after many
                of these from one address or overall. With 503 if the issuer has to be asked and
                does not answer.
            StoreError: If the database does not answer, and the token is not remembered.
        """
        refusal = RefusedError(401, "wrong or missing token: send it as `Authorization: Bearer …`")
        try:
            principal = self._look_up(token)
        except RefusedError as error:
            if error.status != HTTPStatus.FORBIDDEN:
                raise
            principal, refusal = None, error
        if principal is not None:
            return principal
        with self._lock:
            pause = self._wrong.count(address)
        if pause:
            raise RefusedError(429, "too many wrong tokens", retry_after=pause)
        # So many entries as wrong tokens are answered as such, and no more: an audit log that a
        # stranger can fill tells nothing.
        self._audit.write(
            None,
            "token.refused",
            text="" if refusal.status == HTTPStatus.UNAUTHORIZED else refusal.text,
            accepted=False,
            address=address,
            required=False,
        )
        raise refusal

    def forget(self, account: str) -> None:
        """Remember no token of an account while the database does not answer: it has changed."""
        with self._lock:
            for key in [one for one, (who, _) in self._known.items() if who.account == account]:
                del self._known[key]

    def _look_up(self, text: str) -> Principal | None:
        given = parse(text)
        if given is None:
            return None if self._issuer is None else self._of_issuer(text, self._issuer)
        key = digest_of(given.secret)
        try:
            found = self._store.tokens.owned(given.id)
        except StoreError:
            principal = self._remembered(key)
            if principal is None or principal.token != given.id:
                raise
            return principal
        if found is None:
            fits(given.secret, _NO_SECRET)  # as long as for a known one
            return None
        token, account = found
        right = fits(given.secret, token.digest)
        if right and token.created < _RELEASED <= self._clock():
            token = self._store.tokens.update(token.id, self._dated)
        valid = not token.revoked and self._clock() < token.expires and not account.disabled
        if not right or not valid:
            self._forget(key)
            return None
        scopes = token.scopes & account.scopes
        return self._admitted(key, account, scopes, token.id, token.expires)

    def _dated(self, token: Token) -> Token:
        """A token that was issued before the machine's clock was set: its days begin now."""
        if token.created >= _RELEASED:
            return token
        now = self._clock()
        return replace(token, created=now, expires=now + token.expires - token.created)

    def _of_issuer(self, text: str, issuer: OidcVerifier) -> Principal | None:
        issued = issuer.issued(text)
        if issued is None:
            return None
        key = digest_of(text)
        try:
            account = self._accounts.of_issued(issued)
        except StoreError:
            principal = self._remembered(key)
            if principal is None:
                raise
            return principal
        if account.disabled:
            self._forget(key)
            return None
        return self._admitted(key, account, account.scopes, issued.subject, issued.expires)

    def _admitted(
        self,
        key: str,
        account: Account,
        scopes: frozenset[Scope],
        token: str,
        expires: float,
    ) -> Principal:
        """Who sends a valid token of an account; remembered while the database does not answer."""
        principal = Principal(
            account=account.name,
            tenant=account.tenant,
            role=account.role,
            scopes=scopes,
            token=token,
        )
        with self._lock:
            # The database and the wall clock may fail together, as a machine starts.
            left = min(expires - self._clock(), _REMEMBERED)
            self._known[key] = (principal, time.monotonic() + left)
            self._known.move_to_end(key)
            if len(self._known) > _MOST_REMEMBERED:
                self._known.popitem(last=False)
        return principal

    def _forget(self, key: str) -> None:
        with self._lock:
            self._known.pop(key, None)

    def _remembered(self, key: str) -> Principal | None:
        with self._lock:
            principal, until = self._known.get(key, (None, 0.0))
        return principal if time.monotonic() < until else None
