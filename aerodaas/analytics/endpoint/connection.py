"""HTTP client of one endpoint: persistent connections, deadlines, bounded replies, few retries."""

from __future__ import annotations

import os
import ssl
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus

import httpx
from pydantic import SecretStr

from aerodaas.config.model import EndpointConfig
from aerodaas.config.secrets import SecretUrl, cleaned
from aerodaas.errors import ConfigError, EndpointError
from aerodaas.http_client import http_client, http_errors, read_at_most

__all__ = ["Connection", "Reply"]

_MOST_BYTES = 64 * 2**20
"""Largest size of a reply; the raw output of a large detector has 3 MB."""
_FIRST_PAUSE = 0.02
"""Delay before the second attempt in seconds; doubled before each further one."""
_LEAST_ATTEMPT = 0.005
"""Remaining time in seconds below which no further attempt is made."""
_BUSY = {
    HTTPStatus.TOO_MANY_REQUESTS,
    HTTPStatus.BAD_GATEWAY,
    HTTPStatus.SERVICE_UNAVAILABLE,
    HTTPStatus.GATEWAY_TIMEOUT,
}
_TEXT_READ = 4096
_TEXT_SHOWN = 200


@dataclass(frozen=True)
class Reply:
    """Reply of the endpoint."""

    status: int
    headers: Mapping[str, str]
    body: bytes
    secrets: tuple[SecretStr | SecretUrl, ...] = ()
    """What the request held, which a server may repeat."""

    @property
    def text(self) -> str:
        """Beginning of the body, for error messages."""
        said = " ".join(self.body[:_TEXT_READ].decode("utf-8", "replace").split())
        return cleaned(said, self.secrets)[:_TEXT_SHOWN] or "an empty reply"


class _AttemptError(Exception):
    """Failure of one attempt; `again` if another may succeed."""

    def __init__(self, kind: str, text: str, *, again: bool) -> None:
        super().__init__(text)
        self.kind = kind
        self.again = again


class Connection:
    """Thread-safe HTTP client of one endpoint, with up to `executors` persistent connections."""

    def __init__(self, config: EndpointConfig, executors: int) -> None:
        """Configure the client, which connects with the first request.

        Raises ConfigError if the environment variable named by `token_env` is not set.
        """
        self.url = SecretUrl(config.url.get_secret_value().rstrip("/"))
        self.failures: Counter[str] = Counter()
        """Failed attempts by kind."""
        self._config = config
        self._secret = _secret(config)
        self._secrets: tuple[SecretStr | SecretUrl, ...] = (
            self.url,
            *map(SecretStr, self._secret.values()),
        )
        secure = self.url.get_secret_value().startswith("https:")
        tls = ssl.create_default_context() if secure else None
        self._client = http_client(config.timeout, tls=tls, connections=executors)

    def ask(
        self,
        method: str,
        url: str,
        *,
        body: bytes | None = None,
        headers: Mapping[str, str] | None = None,
        budget: float | None = None,
    ) -> Reply:
        """Send a request and return the reply, of any status except those of a busy server.

        Args:
            method: HTTP method.
            url: Address of the resource.
            body: Body of the request; None for none.
            headers: Further headers.
            budget: Wall seconds for the reply, capped by the endpoint's `timeout`; None for that.

        Raises:
            EndpointError: Without a reply within `budget`.
        """
        timeout = self._config.timeout
        until = time.monotonic() + (timeout if budget is None else min(timeout, budget))
        pause = _FIRST_PAUSE
        for attempt in range(self._config.retries + 1):
            try:
                return self._attempt(method, url, body, {**(headers or {}), **self._secret}, until)
            except _AttemptError as failure:
                self.failures[failure.kind] += 1
                last = attempt == self._config.retries
                late = time.monotonic() + pause + _LEAST_ATTEMPT > until
                if last or late or not failure.again:
                    tries = f" ({attempt + 1} attempts)" if attempt else ""
                    raise EndpointError(f"{self.url}: {failure}{tries}") from None
            time.sleep(pause)
            pause *= 2
        raise AssertionError  # the last attempt returns or raises

    def cleaned(self, text: str) -> str:
        """Return a text, such as a library's error message, without what must stay secret."""
        return cleaned(text, self._secrets)

    def close(self) -> None:
        """Close all connections."""
        self._client.close()

    def _attempt(
        self, method: str, url: str, body: bytes | None, headers: Mapping[str, str], until: float
    ) -> Reply:
        left = until - time.monotonic()
        if left <= 0:
            raise _AttemptError("timeout", "no time left to ask", again=False)
        with (
            http_errors(self._failure),
            self._client.stream(
                method, url, content=body, headers=headers, timeout=left
            ) as response,
        ):
            if response.headers.get("Content-Encoding", "identity").lower() != "identity":
                text = "sent a compressed reply, which was not asked for; switch it off there"
                raise _AttemptError("compressed", text, again=False)
            content = read_at_most(response, _MOST_BYTES + 1, until)
        if len(content) > _MOST_BYTES:
            text = f"sent more than {_MOST_BYTES >> 20} MiB; is this the address of a model?"
            raise _AttemptError("huge", text, again=False)
        if response.status_code in _BUSY:
            text = f"is busy (status {response.status_code})"
            raise _AttemptError("busy", text, again=True)
        if response.has_redirect_location:
            text = "redirects elsewhere; give the address that it redirects to as endpoint.url"
            raise _AttemptError("redirect", text, again=False)
        return Reply(response.status_code, response.headers, content, self._secrets)

    def _failure(self, error: Exception) -> _AttemptError:
        if isinstance(error, httpx.TimeoutException):
            return _AttemptError("timeout", "did not answer in time", again=False)
        refused = isinstance(error, httpx.ConnectError)
        kind, said = ("refused", "cannot be reached") if refused else ("broken", "broke off")
        again = isinstance(error, httpx.NetworkError | httpx.RemoteProtocolError)
        return _AttemptError(kind, f"{said}: {self.cleaned(str(error))}", again=again)


def _secret(config: EndpointConfig) -> dict[str, str]:
    if config.token_env is None:
        return {}
    secret = os.environ.get(config.token_env, "")
    if not secret:
        raise ConfigError(
            f"{config.url} wants a secret: set the environment variable {config.token_env} "
            "where the edge node's Ray is started"
        )
    if config.token_header.lower() == "authorization":
        secret = f"Bearer {secret}"
    return {config.token_header: secret}
