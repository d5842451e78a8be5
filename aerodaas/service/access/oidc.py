"""OpenID Connect: who sends a request, by a token that the provider's issuer has signed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import jwt

from aerodaas.protocol.schemas import Role
from aerodaas.service.access.issuer_keys import IssuerKeys
from aerodaas.service.errors import RefusedError
from aerodaas.types.errors import SourceError

__all__ = ["Issued", "OidcSettings", "OidcVerifier"]

_ALGORITHMS = frozenset(
    {"RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA"}
)
"""Signatures by public keys. Neither `none` nor HMAC, by which whoever checks could sign."""
_REQUIRED = ("exp", "iat", "iss", "aud", "sub")
_LEEWAY = 30.0
"""Seconds by which clocks may differ."""
_LONGEST = 16 << 10
_LONGEST_SUBJECT = 255
"""Characters that OpenID Connect allows."""
_WORD = re.compile(r"[^\W\d][\w\-]{0,63}")


@dataclass(frozen=True)
class OidcSettings:
    """What the provider trusts an issuer with."""

    issuer: str
    """URL, exactly as the issuer writes it."""
    audience: str
    """What its tokens are for: this service."""
    role_claim: str = "aerodaas_role"
    """Claim with a role or a list of them; dots go into objects."""
    tenant_claim: str = "aerodaas_tenant"
    roles: Mapping[str, Role] = field(default_factory=dict)
    """Role by value of the claim; empty: the roles by their own names."""
    unknown: Role | None = None
    """Role of who has none of these; None: they are refused."""


@dataclass(frozen=True, slots=True)
class Issued:
    """What a valid token says."""

    subject: str
    """Who, for ever: the issuer and its id of them."""
    name: str
    """How to call them; others may be called so, too."""
    tenant: str
    role: Role
    expires: float
    """Seconds of Unix time."""


class OidcVerifier:
    """Verifies tokens; threads may share it."""

    def __init__(self, settings: OidcSettings) -> None:
        """Trust the issuer of `settings`; raises ConfigError for an address that is not https."""
        self._settings = settings
        self._keys = IssuerKeys(settings.issuer)

    def issued(self, token: str) -> Issued | None:
        """What a token says; None for one that is not valid here, whatever is wrong with it.

        Raises:
            RefusedError: With status 403 for a valid one without tenant, or without a role that
                is known where the policy wants one; 503 if the issuer cannot be asked for its
                keys.
        """
        claims = self._claims(token)
        if claims is None or not 0 < len(claims["sub"]) <= _LONGEST_SUBJECT:
            return None
        tenant = _claim(claims, self._settings.tenant_claim)
        if not isinstance(tenant, str) or not _WORD.fullmatch(tenant):
            raise RefusedError(
                403,
                f"the token's claim {self._settings.tenant_claim} names no tenant: have the "
                "issuer set it to a word",
            )
        name = claims.get("preferred_username")
        return Issued(
            subject=f"{self._settings.issuer} {claims['sub']}",
            name=name if isinstance(name, str) else claims["sub"],
            tenant=tenant,
            role=self._role(claims),
            expires=float(claims["exp"]),
        )

    def _claims(self, token: str) -> dict[str, Any] | None:
        if len(token) > _LONGEST:
            return None
        try:
            head = jwt.get_unverified_header(token)
            id_, algorithm = head.get("kid"), head.get("alg")
            if not isinstance(id_, str) or algorithm not in _ALGORITHMS:
                return None
            key = self._keys.key(id_)
            if key is None or key.algorithm_name not in _ALGORITHMS:
                return None
            claims: dict[str, Any] = jwt.decode(
                token,
                # Its own algorithm goes with the key: the token does not choose how it is read.
                key,
                algorithms=[key.algorithm_name],
                audience=self._settings.audience,
                issuer=self._settings.issuer,
                leeway=_LEEWAY,
                options={"require": list(_REQUIRED)},
            )
        except SourceError as error:
            raise RefusedError(503, f"{error}; use a token of this service") from None
        except (jwt.PyJWTError, ValueError, TypeError, OverflowError, RecursionError):
            return None
        return claims

    def _role(self, claims: Mapping[str, Any]) -> Role:
        given = _claim(claims, self._settings.role_claim)
        known = self._settings.roles or {role.value: role for role in Role}
        names = given if isinstance(given, list) else [given]
        best = self._settings.unknown
        for name in names:
            role = known.get(name) if isinstance(name, str) else None
            if role is not None and (best is None or role.reaches(best)):
                best = role
        if best is None:
            raise RefusedError(
                403,
                f"the token's claim {self._settings.role_claim} has no role of this service "
                f"({', '.join(known)})",
            )
        return best


def _claim(claims: Mapping[str, Any], path: str) -> Any:  # noqa: ANN401 - JSON
    """A claim by its name, or by the way to it in objects."""
    if path in claims:
        return claims[path]
    found: Any = claims
    for part in path.split("."):
        found = found.get(part) if isinstance(found, dict) else None
    return found
