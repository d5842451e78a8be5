"""Accounts, tenants, tokens, the audit log and the accounts of use."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel, ConfigDict

from aerodaas.protocol.schemas import (
    AccountIn,
    AccountOut,
    AuditOut,
    Role,
    Scope,
    TenantChange,
    TenantOut,
    TokenIn,
    TokenOut,
    UsageOut,
)
from aerodaas.service.access.accounts import Accounts
from aerodaas.service.access.audit import Audit
from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.gate import Admission
from aerodaas.service.store import Account, AuditEntry, Store, Tenant, Token, Usage

__all__ = ["AccountRoutes"]

_MOST_ENTRIES = 1000


class AccountChange(BaseModel):
    """Changes of an account; None for none."""

    model_config = ConfigDict(extra="forbid")

    role: Role | None = None
    scopes: list[Scope] | None = None
    disabled: bool | None = None


class AccountRoutes:
    """Routes `/v1/accounts`, `/v1/tenants`, `/v1/tokens`, `/v1/audit` and `/v1/usage`."""

    def __init__(
        self, accounts: Accounts, store: Store, admission: Admission, audit: Audit
    ) -> None:
        """Answer from these."""
        self._accounts = accounts
        self._store = store
        self._admission = admission
        self._audit = audit

    def router(self) -> APIRouter:
        """The routes."""
        router = api_router("/v1", "accounts")
        one: dict[str, Any] = {"response_model": AccountOut}
        router.add_api_route("/accounts", self.accounts, response_model=list[AccountOut])
        router.add_api_route("/accounts", self.add, methods=["POST"], status_code=201, **one)
        router.add_api_route("/accounts/{name}", self.change, methods=["PATCH"], **one)
        router.add_api_route("/tenants", self.tenants, response_model=list[TenantOut])
        router.add_api_route(
            "/tenants/{name}", self.change_tenant, methods=["PATCH"], response_model=TenantOut
        )
        router.add_api_route("/tokens", self.tokens, response_model=list[TokenOut])
        router.add_api_route("/tokens", self.issue, methods=["POST"], status_code=201)
        router.add_api_route(
            "/tokens/{token}", self.revoke, methods=["DELETE"], response_model=TokenOut
        )
        router.add_api_route("/audit", self.audit, response_model=list[AuditOut])
        router.add_api_route("/usage", self.usage, response_model=list[UsageOut])
        return router

    def accounts(self, request: Request) -> list[Account]:
        """All accounts."""
        self._admission.require(request, Role.ADMIN)
        return self._store.accounts.all()

    def add(self, account: AccountIn, request: Request) -> Account:
        """Make an account, and its tenant if it is a new one."""
        principal = self._admission.require(request, Role.ADMIN)
        made = self._accounts.add(account)
        role = account.role.value
        self._audit.write(principal, "account.add", account.name, role, accepted=True)
        return made

    def change(self, name: str, body: AccountChange, request: Request) -> Account:
        """Change an account's role or scopes, or disable it; its tokens obey at once."""
        principal = self._admission.require(request, Role.ADMIN)
        found = self._accounts.change(
            name, role=body.role, scopes=body.scopes, disabled=body.disabled
        )
        text = body.model_dump_json(exclude_none=True)
        self._audit.write(principal, "account.change", name, text, accepted=True)
        return found

    def tenants(self, request: Request) -> list[Tenant]:
        """One's own tenant with what it may use; all of them for an administrator."""
        principal = self._admission.require(request, Role.VIEWER)
        if principal.role.reaches(Role.ADMIN):
            return self._store.tenants.all()
        return [self._store.tenants.require(principal.tenant)]

    def change_tenant(self, name: str, body: TenantChange, request: Request) -> Tenant:
        """Change what a tenant may use: of missions that begin from now on."""
        principal = self._admission.require(request, Role.ADMIN)
        changes = body.model_dump(exclude_unset=True)
        found = self._store.tenants.update(name, lambda one: replace(one, **changes))
        text = body.model_dump_json(exclude_unset=True)
        self._audit.write(principal, "tenant.change", name, text, accepted=True)
        return found

    def tokens(self, request: Request) -> list[Token]:
        """One's own tokens; all of them for an administrator. Secrets are not among it."""
        principal = self._admission.require(request, Role.VIEWER)
        every = principal.role.reaches(Role.ADMIN)
        return self._store.tokens.all(None if every else principal.account)

    def issue(self, body: TokenIn, request: Request) -> TokenOut:
        """Make a token; this answer alone has its secret."""
        principal = self._admission.require(request, Role.ADMIN)
        made = self._accounts.issue(body)
        self._audit.write(principal, "token.issue", made.id, body.account, accepted=True)
        return made

    def revoke(self, token: str, request: Request) -> Token:
        """Revoke a token."""
        principal = self._admission.require(request, Role.ADMIN)
        found = self._accounts.revoke(token)
        owner = found.account
        self._audit.write(principal, "token.revoke", token, owner, accepted=True, required=False)
        return found

    def audit(
        self, request: Request, limit: Annotated[int, Query(ge=1, le=_MOST_ENTRIES)] = 100
    ) -> list[AuditEntry]:
        """The newest entries of the audit log."""
        self._admission.require(request, Role.ADMIN)
        return self._audit.newest(limit)

    def usage(self, request: Request) -> list[Usage]:
        """Usage by mission: the tenant's own, or all for an operator."""
        principal = self._admission.require(request, Role.VIEWER)
        every = principal.role.reaches(Role.OPERATOR)
        return self._store.usage.all(None if every else principal.tenant)
