"""Signing keys of an OpenID Connect issuer, as it publishes them."""

from __future__ import annotations

import ssl
import threading
import time
from collections.abc import Callable
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

import jwt

from aerodaas.errors import ConfigError, SourceError
from aerodaas.http_server.addresses import is_loopback
from aerodaas.text.printable import printable

__all__ = ["IssuerKeys", "require_secure"]

_TIMEOUT = 5.0
_FRESH = 600.0
"""Seconds after which the keys are fetched again: one that was withdrawn is good no longer."""
_STALE = 3600.0
"""Seconds for which the last known keys are good while the issuer does not answer."""
_AGAIN = 10.0
"""Least seconds between two fetches: made-up key ids do not make this service flood the issuer."""
_FAILURES = (jwt.PyJWTError, ConfigError, OSError, ValueError, TypeError, RecursionError)
"""Errors of an issuer that is down, or that answers by something else."""
_DISCOVERY = "/.well-known/openid-configuration"


def require_secure(url: str, what: str) -> None:
    """Check that `url` is https, or http on this machine: keys must not be forged.

    Args:
        url: The address.
        what: What it is the address of, for the error.

    Raises:
        ConfigError: If the address is another one, or a proxy would be asked.
    """
    parts = urlsplit(url)
    secure = parts.scheme == "https" or (
        parts.scheme == "http" and is_loopback(parts.hostname or "")
    )
    if not secure or not parts.hostname or parts.username is not None:
        raise ConfigError(f"{what} is https://host without a user, not {printable(url)[:200]!r}")
    if parts.scheme == "http" and "http" in getproxies() and not proxy_bypass(parts.hostname):
        raise ConfigError(f"{what} on this machine is not asked by http_proxy: set no_proxy, too")


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
        self._tls = ssl.create_default_context()

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
            except _FAILURES as error:
                self._failed = printable(str(error))[:500]
            else:
                self._fetched = now

    def _fetch(self) -> dict[str, jwt.PyJWK]:
        """The keys by their ids; raises ValueError for an answer of another kind."""
        about = self._client(self._issuer.rstrip("/") + _DISCOVERY).fetch_data()
        if about.get("issuer") != self._issuer:
            raise ValueError(f"it calls itself {about.get('issuer')!r}, not {self._issuer!r}")
        where = str(about.get("jwks_uri"))
        require_secure(where, "the address of an issuer's keys")
        try:
            published = self._client(where).get_jwk_set().keys
        except jwt.PyJWKSetError:
            # All are withdrawn: the last known ones are good no longer.
            return {}
        return {
            key.key_id: key
            for key in published
            if key.key_id and key.public_key_use in {None, "sig"}
        }

    def _client(self, url: str) -> jwt.PyJWKClient:
        # Its own cache would ask an issuer that is down at every request, and forget its keys.
        return jwt.PyJWKClient(url, cache_jwk_set=False, timeout=_TIMEOUT, ssl_context=self._tls)
