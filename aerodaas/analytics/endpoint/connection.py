"""HTTP client of one endpoint: persistent connections, deadlines, bounded replies, few retries."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus

import urllib3
from pydantic import SecretStr
from urllib3.exceptions import HTTPError, NewConnectionError, ProtocolError
from urllib3.exceptions import TimeoutError as NoTimeLeft

from aerodaas.config.model import EndpointConfig
from aerodaas.config.secrets import SecretUrl, cleaned
from aerodaas.errors import ConfigError, EndpointError

__all__ = ["Connection", "Reply"]

_MOST_BYTES = 64 * 2**20
"""Largest size of a reply; the raw output of a large detector has 3 MB."""
_CHUNK = 1 << 18
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
        self._pool = urllib3.PoolManager(maxsize=executors, block=True, retries=False)

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

        `budget` is the time for the reply in wall-clock seconds, capped by the endpoint's
        `timeout`. Raises EndpointError without a reply within it.
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
        self._pool.clear()

    def _attempt(
        self, method: str, url: str, body: bytes | None, headers: Mapping[str, str], until: float
    ) -> Reply:
        left = until - time.monotonic()
        if left <= 0:
            raise _AttemptError("timeout", "no time left to ask", again=False)
        try:
            response = self._pool.request(
                method,
                url,
                body=body,
                # A compressed reply could unpack to any size.
                headers={**headers, "Accept-Encoding": "identity"},
                timeout=urllib3.Timeout(left),
                pool_timeout=left,
                redirect=False,
                preload_content=False,
            )
            try:
                content = _read(response, until)
            except BaseException:
                # Unread bytes must not be taken for the next request's reply.
                response.close()
                raise
            response.release_conn()
        except NewConnectionError as error:
            reason = self.cleaned(str(error).rpartition(": ")[2])
            raise _AttemptError("refused", f"cannot be reached: {reason}", again=True) from None
        except NoTimeLeft:
            raise _AttemptError("timeout", "did not answer in time", again=False) from None
        except ProtocolError as error:
            text = self.cleaned(f"broke off: {error.args[0]}")
            raise _AttemptError("broken", text, again=True) from None
        except HTTPError as error:
            text = self.cleaned(f"does not speak HTTP: {error}")
            raise _AttemptError("broken", text, again=False) from None
        if response.status in _BUSY:
            raise _AttemptError("busy", f"is busy (status {response.status})", again=True)
        if response.get_redirect_location():
            text = "redirects elsewhere; give the address that it redirects to as endpoint.url"
            raise _AttemptError("redirect", text, again=False)
        return Reply(response.status, response.headers, content, self._secrets)


def _read(response: urllib3.BaseHTTPResponse, until: float) -> bytes:
    if response.headers.get("Content-Encoding", "identity").lower() != "identity":
        text = "sent a compressed reply, which was not asked for; switch compression off there"
        raise _AttemptError("compressed", text, again=False)
    content = bytearray()
    while chunk := response.read1(_CHUNK, decode_content=False):
        content += chunk
        if len(content) > _MOST_BYTES:
            text = f"sent more than {_MOST_BYTES >> 20} MiB; is this the address of a model?"
            raise _AttemptError("huge", text, again=False)
        if time.monotonic() > until:
            raise _AttemptError("timeout", "did not answer in time", again=False)
    return bytes(content)


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
