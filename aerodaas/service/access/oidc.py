"""OpenID Connect: who sends a request, by a token that the provider's issuer has signed."""

from __future__ import annotations

import logging
import math
import re
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import jwt

from aerodaas.errors import SourceError
from aerodaas.protocol.schemas import Role
from aerodaas.service.access.issuer_keys import IssuerKeys
from aerodaas.service.errors import RefusedError
from aerodaas.text.printable import printable

__all__ = ["Issued", "OidcSettings", "OidcVerifier"]

_log = logging.getLogger(__name__)
_ALGORITHMS = frozenset(
    {"RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA"}
)
"""Signatures by public keys. Neither `none` nor HMAC, by which whoever checks could sign."""
_REQUIRED = ("exp", "iat", "iss", "aud", "sub")
_LEEWAY = 30.0
"""Seconds by which clocks may differ."""
_LONGEST = 16 << 10
_SHOWN = 200
"""Characters of a stranger's value that are logged."""
_LATEST = 1e12
"""Unix seconds beyond which nothing expires."""
_TOLD_SECONDS = 10.0
"""Least seconds between two lines of the log on invalid tokens."""
_LONGEST_SUBJECT = 255
"""Characters that OpenID Connect allows."""
_WORD = re.compile(r"[^\W\d][\w\-]{0,63}")


@dataclass(frozen=True)
class OidcSettings:
    """Settings by which the provider trusts an issuer."""

    issuer: str
    """URL, exactly as the issuer writes it."""
    audience: str
    """Audience of its tokens: this service."""
    role_claim: str = "aerodaas_role"
    """Claim with a role or a list of them; dots go into objects."""
    tenant_claim: str = "aerodaas_tenant"
    roles: Mapping[str, Role] = field(default_factory=dict)
    """Role by value of the claim; empty: the roles by their own names."""


@dataclass(frozen=True, slots=True)
class Issued:
    """Claims of a valid token."""

    subject: str
    """Permanent id of the account: the issuer and its own id of it."""
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
        self._lock = threading.Lock()
        self._silent_until = -math.inf
        self._untold = 0
        """Invalid tokens since the last one that was told."""

    def issued(self, token: str) -> Issued | None:
        """Claims of a token; None for one that is not valid here, whatever is wrong with it.

        Raises:
            RefusedError: With status 403 for a valid one without tenant, or without a role that
                is known where the policy wants one; 503 if the issuer cannot be asked for its
                keys.
        """
        try:
            claims = self._claims(token)
        except _InvalidError as error:
            self._report(str(error))
            return None
        if claims is None:
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

    def _report(self, reason: str) -> None:
        """Log why a token is not valid, for the provider alone, at most once in a while."""
        with self._lock:
            now = time.monotonic()
            self._untold += 1
            if now < self._silent_until:
                return
            self._silent_until, count, self._untold = now + _TOLD_SECONDS, self._untold, 0
        more = f" ({count - 1} more since the last one that was told)" if count > 1 else ""
        _log.warning("a token of %s is refused: %s%s", self._settings.issuer, reason, more)

    def _claims(self, token: str) -> dict[str, Any] | None:
        """The claims of a valid token; None for what is no JWT at all, _InvalidError for others."""
        if len(token) > _LONGEST:
            raise _InvalidError(f"it has more than {_LONGEST} characters")
        try:
            head = jwt.get_unverified_header(token)
        except (jwt.PyJWTError, ValueError, TypeError, RecursionError):
            return None
        try:
            id_, algorithm = head.get("kid"), head.get("alg")
            if algorithm not in _ALGORITHMS:
                raise _InvalidError(f"it is signed by {_shown(algorithm)}, which is not taken")
            if not isinstance(id_, str):
                raise _InvalidError("its header has no kid, the id of the key that signed it")
            key = self._keys.key(id_)
            if key is None or key.algorithm_name not in _ALGORITHMS:
                raise _InvalidError(f"the issuer publishes no key {_shown(id_)} (kid)")
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
        except (jwt.PyJWTError, ValueError, TypeError, OverflowError, RecursionError) as error:
            raise _InvalidError(self._reason(token, error)) from None
        if not 0 < len(claims["sub"]) <= _LONGEST_SUBJECT:
            raise _InvalidError(f"its sub has {len(claims['sub'])} characters")
        if not claims["exp"] < _LATEST:
            raise _InvalidError("its exp is beyond all time")
        return claims

    def _reason(self, token: str, error: Exception) -> str:  # noqa: PLR0911 - one kind each
        """Why a token is not valid, with the claim that is wrong."""
        if isinstance(error, jwt.InvalidSignatureError):
            return "its signature is not that of its key"
        try:
            # Claims are looked at once the signature fits; these are for the log.
            claims = jwt.decode(token, options={"verify_signature": False})
        except (jwt.PyJWTError, ValueError, TypeError, OverflowError, RecursionError):
            return "it cannot be read"
        wanted, now = self._settings, time.time()
        missing = error.claim if isinstance(error, jwt.MissingRequiredClaimError) else ""
        if missing == "aud" and "client_id" in claims:
            return (
                f"it has no aud, but client_id {_shown(claims['client_id'])}: an access token of "
                "Amazon Cognito has none; send the ID token"
            )
        if missing:
            return f"it has no {missing}"
        if isinstance(error, jwt.InvalidAudienceError):
            return f"its aud is {_shown(claims.get('aud'))}, not {wanted.audience!r}"
        if isinstance(error, jwt.InvalidIssuerError):
            return f"its iss is {_shown(claims.get('iss'))}, not {wanted.issuer!r}, to the letter"
        if isinstance(error, jwt.ExpiredSignatureError):
            return f"its exp is {_shown(claims.get('exp'))}, and this machine's clock is {now:.0f}"
        if isinstance(error, jwt.ImmatureSignatureError | jwt.InvalidIssuedAtError):
            begun = {name: claims[name] for name in ("iat", "nbf") if name in claims}
            return (
                f"it begins later than now, by {_shown(begun)}, and this machine's clock is "
                f"{now:.0f}: set both clocks by NTP"
            )
        return str(error)[:_SHOWN]

    def _role(self, claims: Mapping[str, Any]) -> Role:
        given = _claim(claims, self._settings.role_claim)
        known = self._settings.roles or {role.value: role for role in Role}
        names = given if isinstance(given, list) else [given]
        best: Role | None = None
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


class _InvalidError(Exception):
    """A token is not valid, with the reason for the provider's log."""


def _shown(value: object) -> str:
    """A stranger's value in a line of the log."""
    return printable(repr(value)[:_SHOWN])


def _claim(claims: Mapping[str, Any], path: str) -> Any:  # noqa: ANN401 - JSON
    """A claim by its name, or by the way to it in objects."""
    if path in claims:
        return claims[path]
    found: Any = claims
    for part in path.split("."):
        found = found.get(part) if isinstance(found, dict) else None
    return found
