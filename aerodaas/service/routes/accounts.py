"""Accounts, tokens, the audit log and the accounts of use."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Response
from pydantic import BaseModel, ConfigDict

from aerodaas.service.access import Accounts, Audit, Principal, reaches, usage_csv, usage_out
from aerodaas.service.routes.admission import Admission
from aerodaas.service.schemas import (
    AccountIn,
    AccountOut,
    AuditOut,
    Role,
    Scope,
    TokenIn,
    TokenOut,
)
from aerodaas.service.store import Store

__all__ = ["accounts_router"]

_MOST_ENTRIES = 1000


class AccountChange(BaseModel):
    """Changes of an account; None for none."""

    model_config = ConfigDict(extra="forbid")

    role: Role | None = None
    scopes: list[Scope] | None = None
    disabled: bool | None = None


def accounts_router(
    accounts: Accounts, store: Store, admission: Admission, audit: Audit
) -> APIRouter:
    """Routes `/v1/accounts`, `/v1/tokens`, `/v1/audit` and `/v1/usage`."""
    router = APIRouter(prefix="/v1")
    admin = Depends(admission.needs(Role.ADMIN))
    viewer = Depends(admission.needs(Role.VIEWER))

    @router.get("/accounts", tags=["accounts"])
    def all_accounts(principal: Annotated[Principal, admin]) -> list[AccountOut]:  # noqa: ARG001
        """All accounts."""
        return accounts.all()

    @router.post("/accounts", tags=["accounts"], status_code=201)
    def add(account: AccountIn, principal: Annotated[Principal, admin]) -> AccountOut:
        """Make an account, and its tenant if it is a new one."""
        made = accounts.add(account)
        audit.write(principal, "account.add", account.name, account.role.value, accepted=True)
        return made

    @router.patch("/accounts/{name}", tags=["accounts"])
    def change(
        name: str, body: AccountChange, principal: Annotated[Principal, admin]
    ) -> AccountOut:
        """Change an account's role or scopes, or disable it; its tokens obey at once."""
        found = accounts.change(name, role=body.role, scopes=body.scopes, disabled=body.disabled)
        audit.write(principal, "account.change", name, body.model_dump_json(), accepted=True)
        return found

    @router.get("/tokens", tags=["accounts"])
    def tokens(principal: Annotated[Principal, viewer]) -> list[TokenOut]:
        """One's own tokens; all of them for an administrator. Secrets are not among it."""
        every = reaches(principal.role, Role.ADMIN)
        return accounts.tokens(None if every else principal.account)

    @router.post("/tokens", tags=["accounts"], status_code=201)
    def issue(body: TokenIn, principal: Annotated[Principal, admin]) -> TokenOut:
        """Make a token; this answer alone has its secret."""
        made = accounts.issue(body)
        audit.write(principal, "token.issue", made.id, body.account, accepted=True)
        return made

    @router.delete("/tokens/{token}", tags=["accounts"])
    def revoke(token: str, principal: Annotated[Principal, admin]) -> TokenOut:
        """Revoke a token."""
        found = accounts.revoke(token)
        audit.write(principal, "token.revoke", token, found.account, accepted=True, required=False)
        return found

    @router.get("/audit", tags=["provider"])
    def entries(
        principal: Annotated[Principal, admin],  # noqa: ARG001
        limit: Annotated[int, Query(ge=1, le=_MOST_ENTRIES)] = 100,
    ) -> list[AuditOut]:
        """The newest entries of the audit log."""
        return audit.newest(limit)

    @router.get("/usage", tags=["provider"])
    def usage(
        principal: Annotated[Principal, viewer],
        form: Annotated[Literal["json", "csv"], Query(alias="format")] = "json",
    ) -> Response:
        """What missions have used: the tenant's own, or all for an operator."""
        every = reaches(principal.role, Role.OPERATOR)
        rows = store.usage.all(None if every else principal.tenant)
        if form == "csv":
            return Response(usage_csv(rows), media_type="text/csv")
        lines = ",".join(usage_out(row).model_dump_json() for row in rows)
        return Response(f"[{lines}]", media_type="application/json")

    return router
