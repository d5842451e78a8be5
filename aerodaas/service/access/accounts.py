"""Accounts and their tokens, as an administrator manages them."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection

from aerodaas.protocol.schemas import AccountIn, AccountOut, Role, Scope, TokenIn, TokenOut
from aerodaas.service.store import Store

__all__ = ["Accounts"]


class Accounts:
    """Makes, changes and lists accounts and tokens; the caller has checked who may.

    Every method raises StoreError if the database does not answer.
    """

    def __init__(self, store: Store, clock: Callable[[], float] = time.time) -> None:
        """Keep them in `store`; `clock` is Unix time."""
        raise NotImplementedError

    def first_token(self) -> str | None:
        """Make the account `admin` with a token; None if there is an account already.

        Returns:
            The token, which is nowhere else: it is to be shown once.
        """
        raise NotImplementedError

    def add(self, account: AccountIn) -> AccountOut:
        """Make an account, and its tenant without quotas if there is none of this name.

        Raises:
            RefusedError: With status 409, if there is one of this name.
        """
        raise NotImplementedError

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
        raise NotImplementedError

    def get(self, name: str) -> AccountOut:
        """An account; raises RefusedError with status 404 if there is none."""
        raise NotImplementedError

    def all(self, tenant: str | None = None) -> list[AccountOut]:
        """Those of a tenant, or all, by name."""
        raise NotImplementedError

    def issue(self, request: TokenIn) -> TokenOut:
        """Make a token; the answer alone has its secret.

        Raises:
            RefusedError: With status 404 for an unknown account; 409 for a disabled one, or one
                with 100 valid tokens; 403 for scopes beyond the account's.
        """
        raise NotImplementedError

    def revoke(self, token: str) -> TokenOut:
        """Revoke a token by its id; raises RefusedError with status 404 if there is none."""
        raise NotImplementedError

    def tokens(self, account: str | None = None) -> list[TokenOut]:
        """Tokens of an account, or all, oldest first, without their secrets."""
        raise NotImplementedError
