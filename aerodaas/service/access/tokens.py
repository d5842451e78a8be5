"""Tokens: how they are made, written and compared."""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from dataclasses import dataclass

__all__ = ["Secret", "digest_of", "fits", "new_secret", "parse"]

_FORM = re.compile(r"aerodaas_([0-9a-f]{16})_([A-Za-z0-9_\-]{43})")
"""`aerodaas_<id>_<secret>`: the first word lets scanners of published files find it."""
_ID_BYTES = 8
_SECRET_BYTES = 32
"""As many as `secrets` takes by default: nobody guesses them, so a plain hash keeps them."""


@dataclass(frozen=True, slots=True)
class Secret:
    """The two parts of a token; `repr` shows the id alone."""

    id: str
    secret: str

    def __repr__(self) -> str:
        return f"Secret({self.id})"

    @property
    def text(self) -> str:
        """What a request carries."""
        return f"aerodaas_{self.id}_{self.secret}"


def new_secret() -> Secret:
    """A new token of 32 random bytes."""
    return Secret(secrets.token_hex(_ID_BYTES), secrets.token_urlsafe(_SECRET_BYTES))


def parse(text: str) -> Secret | None:
    """The parts of a token; None for what has not its form."""
    found = _FORM.fullmatch(text)
    return Secret(*found.groups()) if found else None


def digest_of(secret: str) -> str:
    """SHA-256 of a secret, hexadecimal: all that is kept of it."""
    return hashlib.sha256(secret.encode()).hexdigest()


def fits(secret: str, digest: str) -> bool:
    """Whether a secret is the one of a digest; compared in constant time."""
    return hmac.compare_digest(digest_of(secret), digest)
