"""Signing keys of an OpenID Connect issuer, as it publishes them."""

from __future__ import annotations

import json
import ssl
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

import jwt
import urllib3
from urllib3.exceptions import HTTPError

from aerodaas.analytics.remote.guard import is_loopback
from aerodaas.config.printable import printable
from aerodaas.errors import ConfigError, SourceError

__all__ = ["IssuerKeys", "require_secure"]

_MOST_BYTES = 1 << 20
_MOST_KEYS = 100
_TIMEOUT = 5.0
_FRESH = 600.0
"""Seconds after which the keys are fetched again: one that was withdrawn is good no longer."""
_STALE = 3600.0
"""Seconds for which the last known keys are good while the issuer does not answer."""
_AGAIN = 10.0
"""Least seconds between two fetches: made-up key ids do not make this service flood the issuer."""
_DISCOVERY = "/.well-known/openid-configuration"


def require_secure(url: str, what: str) -> None:
    """Raise ConfigError unless `url` is https, or http on this machine: keys must not be forged."""
    parts = urlsplit(url)
    secure = parts.scheme == "https" or (
        parts.scheme == "http" and is_loopback(parts.hostname or "")
    )
    if not secure or not parts.hostname or parts.username is not None:
        raise ConfigError(f"{what} is https://host without a user, not {printable(url)[:200]!r}")


class IssuerKeys:
    """Fetches an issuer's keys when they are needed, and follows their rotation.

    Threads may share it.
    """

    def __init__(self, issuer: str, clock: Callable[[], float] = time.monotonic) -> None:
        """Use the keys of `issuer`, a URL; `clock` is in seconds.

        Raises:
            ConfigError: For a URL that is not https.
        """
        require_secure(issuer, "an OpenID Connect issuer")
        self._issuer = issuer
        self._clock = clock
        self._lock = threading.Lock()
        self._keys: dict[str, jwt.PyJWK] = {}
        self._fetched = self._tried = -float("inf")
        self._failed = ""
        self._pool = urllib3.PoolManager(
            retries=False,
            timeout=urllib3.Timeout(_TIMEOUT),
            ssl_context=ssl.create_default_context(),
        )

    def key(self, id_: str) -> jwt.PyJWK | None:
        """The key of an id; None if the issuer has none of it.

        Raises:
            SourceError: If the issuer does not answer, and the last known keys are too old.
        """
        now = self._clock()
        found = self._keys.get(id_)
        if found is None or now - self._fetched > _FRESH:
            self._refresh(now)
            found = self._keys.get(id_)
        if now - self._fetched > _STALE:
            raise SourceError(f"the issuer {self._issuer} does not answer: {self._failed}")
        return found

    def _refresh(self, now: float) -> None:
        with self._lock:
            if now - self._tried < _AGAIN:
                return
            self._tried = now
            try:
                self._keys = self._fetch()
            except (HTTPError, OSError, ValueError, RecursionError, ConfigError) as error:
                self._failed = printable(str(error))[:500]
            else:
                self._fetched = now

    def _fetch(self) -> dict[str, jwt.PyJWK]:
        """The keys by their ids; raises ValueError for an answer of another kind."""
        about = self._read(self._issuer.rstrip("/") + _DISCOVERY)
        if about.get("issuer") != self._issuer:
            raise ValueError(f"it calls itself {about.get('issuer')!r}, not {self._issuer!r}")
        where = str(about.get("jwks_uri"))
        require_secure(where, "the address of an issuer's keys")
        published = self._read(where).get("keys")
        if not isinstance(published, list):
            raise ValueError("its set of keys has no keys")  # noqa: TRY004 - as all of its kind
        return dict(filter(None, map(_signing_key, published[:_MOST_KEYS])))

    def _read(self, url: str) -> dict[str, Any]:
        with self._pool.request("GET", url, preload_content=False, redirect=False) as answer:
            content = answer.read(_MOST_BYTES + 1)
            if answer.status != HTTPStatus.OK or len(content) > _MOST_BYTES:
                answer.close()
                raise ValueError(f"{url} answered with status {answer.status}, or too much")
        found = json.loads(content)
        if not isinstance(found, dict):
            raise ValueError(f"{url} answered with no JSON object")  # noqa: TRY004 - as above
        return found


def _signing_key(content: Any) -> tuple[str, jwt.PyJWK] | None:  # noqa: ANN401 - JSON
    """A published key with its id; None for one that signs nothing or is not public."""
    if not isinstance(content, dict) or content.get("kty") not in {"RSA", "EC", "OKP"}:
        return None
    if content.get("use", "sig") != "sig" or not isinstance(content.get("kid"), str):
        return None
    try:
        return content["kid"], jwt.PyJWK(content)
    except (jwt.PyJWTError, ValueError, TypeError, KeyError):
        # A kind that this version does not know; tokens of it are refused.
        return None
