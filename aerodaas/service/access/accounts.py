"""Accounts and their tokens, as an administrator manages them."""

from __future__ import annotations

import hashlib
import re
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import replace

from aerodaas.protocol.schemas import AccountIn, AccountOut, Role, Scope, TokenIn, TokenOut
from aerodaas.service.access.oidc import Issued
from aerodaas.service.access.tokens import digest_of, new_secret
from aerodaas.service.errors import RefusedError
from aerodaas.service.store import Account, Store, Tenant, Token

__all__ = ["Accounts"]

_FIRST = "admin"
_FIRST_DAYS = 365.0
_NAME_LETTERS = 40
_MOST_TOKENS = 100
_DAY = 86400.0
"""Seconds."""


class Accounts:
    """Makes, changes and lists accounts and tokens; the caller has checked who may.

    Every method raises StoreError if the database does not answer. Threads may share it.
    """

    def __init__(self, store: Store, clock: Callable[[], float] = time.time) -> None:
        """Keep them in `store`; `clock` is Unix time."""
        self._store = store
        self._clock = clock
        self._lock = threading.Lock()
        self.on_change: Callable[[str], None] = lambda _: None
        """Called with the name of an account that has changed, or lost a token."""

    def first_token(self) -> str | None:
        """Make the account `admin` with a token of a year; None if there is a token already.

        Returns:
            The token, which is nowhere else: it is to be shown once.
        """
        if self._store.tokens.all():
            return None
        if self._store.accounts.get(_FIRST) is None:
            self.add(AccountIn(name=_FIRST, tenant=_FIRST, role=Role.ADMIN))
        return self.issue(TokenIn(account=_FIRST, days=_FIRST_DAYS)).secret

    def add(self, account: AccountIn) -> AccountOut:
        """Make an account, and its tenant without quotas if there is none of this name.

        Raises:
            RefusedError: With status 409, if there is one of this name.
        """
        now = self._clock()
        row = Account(
            name=account.name,
            tenant=account.tenant,
            role=account.role,
            scopes=frozenset(account.scopes),
            created=now,
        )
        with self._lock:
            self._add(row)
        return _account_out(row)

    def of_issued(self, issued: Issued) -> Account:
        """The account of a token's subject, with the token's tenant and role.

        It is made at the first request; its scopes, and whether it is disabled, are the
        administrator's to change.
        """
        row = self._store.accounts.of_subject(issued.subject)
        if row is not None and (row.tenant, row.role) == (issued.tenant, issued.role):
            return row
        with self._lock:
            row = self._store.accounts.of_subject(issued.subject)
            if row is None:
                row = Account(
                    name=_name_of(issued),
                    tenant=issued.tenant,
                    role=issued.role,
                    scopes=frozenset(Scope),
                    created=self._clock(),
                    subject=issued.subject,
                )
                self._add(row)
                return row
            self._add_tenant(issued.tenant)
            return self._store.accounts.update(
                row.name, lambda one: replace(one, tenant=issued.tenant, role=issued.role)
            )

    def _add(self, row: Account) -> None:
        self._add_tenant(row.tenant)
        self._store.accounts.add(row)

    def _add_tenant(self, name: str) -> None:
        if self._store.tenants.get(name) is None:
            self._store.tenants.add(Tenant(name, created=self._clock()))

    def change(
        self,
        name: str,
        *,
        role: Role | None = None,
        scopes: Collection[Scope] | None = None,
        disabled: bool | None = None,
    ) -> AccountOut:
        """Change what is not None; its tokens obey at once.

        Raises:
            RefusedError: With status 404 for an unknown account; 409 if no administrator would
                be left.
        """
        with self._lock:
            others = [
                one
                for one in self._store.accounts.all()
                if one.role is Role.ADMIN and not one.disabled and one.name != name
            ]

            def changed(row: Account) -> Account:
                new = replace(
                    row,
                    role=row.role if role is None else role,
                    scopes=row.scopes if scopes is None else frozenset(scopes),
                    disabled=row.disabled if disabled is None else disabled,
                )
                if not others and (new.role is not Role.ADMIN or new.disabled):
                    raise RefusedError(409, "no administrator would be left: make another first")
                return new

            found = _account_out(self._store.accounts.update(name, changed))
        self.on_change(name)
        return found

    def get(self, name: str) -> AccountOut:
        """An account; raises RefusedError with status 404 if there is none."""
        return _account_out(self._store.accounts.demand(name))

    def all(self, tenant: str | None = None) -> list[AccountOut]:
        """Those of a tenant, or all, by name."""
        return [_account_out(row) for row in self._store.accounts.all(tenant)]

    def issue(self, request: TokenIn) -> TokenOut:
        """Make a token; the answer alone has its secret.

        Raises:
            RefusedError: With status 404 for an unknown account; 409 for a disabled one, or one
                with 100 valid tokens; 403 for scopes beyond the account's.
        """
        now = self._clock()
        account = self._store.accounts.demand(request.account)
        if account.disabled:
            raise RefusedError(409, f"account {account.name} is disabled")
        scopes = account.scopes if request.scopes is None else frozenset(request.scopes)
        if scopes - account.scopes:
            beyond = ", ".join(sorted(scope.value for scope in scopes - account.scopes))
            raise RefusedError(403, f"account {account.name} itself may not {beyond}")
        new = new_secret()
        row = Token(
            id=new.id,
            account=account.name,
            digest=digest_of(new.secret),
            scopes=scopes,
            created=now,
            expires=now + request.days * _DAY,
        )
        with self._lock:
            tokens = self._store.tokens.all(account.name)
            if sum(not one.revoked and now < one.expires for one in tokens) >= _MOST_TOKENS:
                raise RefusedError(
                    409, f"account {account.name} has {_MOST_TOKENS} tokens: revoke some"
                )
            self._store.tokens.add(row)
        return _token_out(row, new.text)

    def revoke(self, token: str) -> TokenOut:
        """Revoke a token by its id; raises RefusedError with status 404 if there is none."""
        row = self._store.tokens.update(token, lambda row: replace(row, revoked=True))
        self.on_change(row.account)
        return _token_out(row)

    def tokens(self, account: str | None = None) -> list[TokenOut]:
        """Tokens of an account, or all, oldest first, without their secrets."""
        return [_token_out(row) for row in self._store.tokens.all(account)]


def _name_of(issued: Issued) -> str:
    """A name that people can read and no other account has, whatever others are called."""
    readable = re.sub(r"[^\w\-]", "-", issued.name)[:_NAME_LETTERS]
    first = "" if readable[:1].isalpha() else "u"
    return f"{first}{readable}-{hashlib.sha256(issued.subject.encode()).hexdigest()[:16]}"


def _account_out(row: Account) -> AccountOut:
    return AccountOut(
        name=row.name,
        tenant=row.tenant,
        role=row.role,
        scopes=_in_order(row.scopes),
        created=row.created,
        disabled=row.disabled,
    )


def _token_out(row: Token, secret: str | None = None) -> TokenOut:
    return TokenOut(
        id=row.id,
        account=row.account,
        scopes=_in_order(row.scopes),
        created=row.created,
        expires=row.expires,
        revoked=row.revoked,
        secret=secret,
    )


def _in_order(scopes: Collection[Scope]) -> list[Scope]:
    return [scope for scope in Scope if scope in scopes]
