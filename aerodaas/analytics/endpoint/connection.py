"""HTTP to one endpoint: kept connections, a budget of time, bounded replies, few retries."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus

import urllib3
from urllib3.exceptions import HTTPError, NewConnectionError, ProtocolError
from urllib3.exceptions import TimeoutError as NoTimeLeft

from aerodaas.config.model import EndpointConfig
from aerodaas.types.errors import ConfigError, EndpointError

__all__ = ["Connection", "Reply"]

_MOST_BYTES = 64 * 2**20
"""Of a reply; the raw output of a large detector has 3 MB."""
_CHUNK = 1 << 18
_FIRST_PAUSE = 0.02
"""Seconds before the second attempt; doubled before each further one."""
_LEAST_ATTEMPT = 0.005
"""Seconds below which another attempt is not worth its while."""
_BUSY = {
    HTTPStatus.TOO_MANY_REQUESTS,
    HTTPStatus.BAD_GATEWAY,
    HTTPStatus.SERVICE_UNAVAILABLE,
    HTTPStatus.GATEWAY_TIMEOUT,
}
_TEXT_SHOWN = 200


@dataclass(frozen=True)
class Reply:
    """What the endpoint answered."""

    status: int
    headers: Mapping[str, str]
    body: bytes

    @property
    def text(self) -> str:
        """The beginning of the body, for a message."""
        shown = " ".join(self.body[:_TEXT_SHOWN].decode("utf-8", "replace").split())
        return shown or "an empty reply"


class _AttemptError(Exception):
    """One attempt has failed; `again` if another may succeed."""

    def __init__(self, kind: str, text: str, *, again: bool) -> None:
        super().__init__(text)
        self.kind = kind
        self.again = again


class Connection:
    """Asks one endpoint. Any number of threads may; `executors` connections are kept open."""

    def __init__(self, config: EndpointConfig, executors: int) -> None:
        """Connect with the first request.

        Raises ConfigError where the environment lacks the secret that `token_env` names.
        """
        self.url = config.url.rstrip("/")
        self.failures: Counter[str] = Counter()
        """Attempts that failed, by kind."""
        self._config = config
        self._secret = _secret(config)
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
        """Send a request and return the reply, whatever its status but those of a busy server.

        `budget` are the wall seconds that the answer is of use; never more than the endpoint's
        `timeout`. Raises EndpointError when there is no reply within it.
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
                headers=dict(headers),
                timeout=urllib3.Timeout(left),
                pool_timeout=left,
                redirect=False,
                preload_content=False,
            )
            try:
                content = _read(response, until)
            except BaseException:
                # What is left unread must not be taken for the next request's reply.
                response.close()
                raise
            response.release_conn()
        except NewConnectionError as error:
            reason = str(error).rpartition(": ")[2]
            raise _AttemptError("refused", f"cannot be reached: {reason}", again=True) from None
        except NoTimeLeft:
            raise _AttemptError("timeout", "did not answer in time", again=False) from None
        except ProtocolError as error:
            raise _AttemptError("broken", f"broke off: {error.args[0]}", again=True) from None
        except HTTPError as error:
            raise _AttemptError("broken", f"does not speak HTTP: {error}", again=False) from None
        if response.status in _BUSY:
            raise _AttemptError("busy", f"is busy (status {response.status})", again=True)
        if response.get_redirect_location():
            text = "redirects elsewhere; give the address that it redirects to as endpoint.url"
            raise _AttemptError("redirect", text, again=False)
        return Reply(response.status, response.headers, content)


def _read(response: urllib3.BaseHTTPResponse, until: float) -> bytes:
    content = bytearray()
    while chunk := response.read1(_CHUNK):
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
