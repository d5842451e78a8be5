"""Principal of a request: its account, its role and its scopes."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.errors import RefusedError

__all__ = ["Principal", "require", "sees"]


@dataclass(frozen=True, slots=True)
class Principal:
    """The account of a valid token, with what the token may be used for."""

    account: str
    tenant: str
    role: Role
    scopes: frozenset[Scope]
    """Scopes of the token that its account still has."""
    token: str
    """The token's id; an issuer's has its subject instead."""
    agent: bool = False
    """Whether its account is an agent's, which proposes missions and flies none."""


def require(
    principal: Principal, role: Role, scope: Scope | None = None, *, agents: bool = False
) -> None:
    """Refuse who may not.

    Args:
        principal: Sender of the request.
        role: The lowest role that may.
        scope: What the token must be good for; None for any.
        agents: Whether agents may, too; to them `propose` stands for `fly`.

    Raises:
        RefusedError: With status 403.
    """
    if principal.agent:
        if not agents:
            raise RefusedError(403, f"{principal.account} is an agent's account: {_REMEDY}")
        scope = Scope.PROPOSE if scope is Scope.FLY else scope
    if not principal.role.reaches(role):
        raise RefusedError(
            403, f"this needs the role {role.value}; {principal.account} is {principal.role.value}"
        )
    if scope is not None and scope not in principal.scopes:
        raise RefusedError(403, f"this token is not good for {scope.value}: ask for one that is")


_REMEDY = (
    "it proposes missions, which an operator approves, and stops those that fly (pause, "
    "return-home, land)"
)


def sees(principal: Principal, tenant: str, share: Collection[str] = ()) -> bool:
    """Whether a principal may see what belongs to `tenant`.

    Args:
        principal: Sender of the request.
        tenant: Owner of a mission, lease or recording.
        share: Further tenants with which the owner shares it; their agents see nothing of it.
    """
    if principal.agent:
        return principal.tenant == tenant
    return principal.tenant in {tenant, *share} or principal.role.reaches(Role.OPERATOR)
