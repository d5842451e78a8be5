"""HTTP exchanges with a provider's service: bounded answers, time limits, refusals."""

from __future__ import annotations

import json
import random
import ssl
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import Any, Literal, TypeAlias

import httpx

from aerodaas.environment.provider.address import ServiceAddress
from aerodaas.errors import AeroDaaSError, ConfigError, MissionError, UnreachableError
from aerodaas.http_client import http_client, http_errors, read_at_most
from aerodaas.text.printable import printable

__all__ = ["Method", "ProviderConnection", "pauses", "printed"]

_MOST_BYTES = 32 << 20
"""Largest JSON of an answer: a mission of 64 robots has a thousandth of that."""
_MOST_TEXT = 2000
"""Characters of a refusal that are shown."""
_CALLERS = frozenset(
    {
        HTTPStatus.BAD_REQUEST,
        HTTPStatus.UNAUTHORIZED,
        HTTPStatus.FORBIDDEN,
        HTTPStatus.NOT_FOUND,
        HTTPStatus.LENGTH_REQUIRED,
        HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
        HTTPStatus.UNPROCESSABLE_ENTITY,
    }
)
"""Refusals of what was asked, which asking again does not mend."""
_GATEWAYS = frozenset({HTTPStatus.BAD_GATEWAY, HTTPStatus.GATEWAY_TIMEOUT})
"""A proxy tells that the service behind it does not answer."""
_LOGIN = "; is the token right? `aerodaas login` stores one"
_REPEATABLE = frozenset({"GET", "HEAD", "PUT", "DELETE"})
"""Methods that change nothing more when they are sent again."""
_CUT = (httpx.ReadError, httpx.WriteError, httpx.RemoteProtocolError)
Method: TypeAlias = Literal["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE"]


class ProviderConnection:
    """Requests to one service; safe in any thread."""

    def __init__(self, address: ServiceAddress, token: str | None, timeout: float) -> None:
        """Ask at `address` as the owner of `token`; wait `timeout` seconds for each answer."""
        self.address = address
        self.ssl = ssl.create_default_context() if address.scheme == "https" else None
        self.headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._client = http_client(timeout, tls=self.ssl)

    def ask(
        self,
        method: Method,
        path: str,
        content: Any = None,  # noqa: ANN401 - JSON
        headers: Mapping[str, str] | None = None,
    ) -> Any:  # noqa: ANN401 - JSON
        """Send a request with JSON.

        Args:
            method: HTTP method.
            path: Path of the resource, with its query.
            content: JSON of the request; None for none.
            headers: Further headers, sent only with content.

        Returns:
            The JSON of the answer, its texts printable.

        Raises:
            ConfigError: With the service's text, for a request that it refuses as such.
            MissionError: With the service's text, for one that it cannot fulfil now, and for an
                answer that is no JSON.
            UnreachableError: If the service cannot be reached, or does not answer in time.
        """
        data = None if content is None else json.dumps(content).encode()
        own = {"Content-Type": "application/json", **(headers or {})}
        _, answer = self.send(method, path, data, own)
        try:
            return printed(json.loads(answer))
        except (ValueError, RecursionError):
            raise self.strange("its answer is no JSON") from None

    def send(
        self,
        method: Method,
        path: str,
        data: bytes | None = None,
        headers: Mapping[str, str] | None = None,
        allowed: frozenset[int] = frozenset(),
        patience: float | None = None,
    ) -> tuple[int, bytes]:
        """Send a request.

        Args:
            method: HTTP method.
            path: Path of the resource, with its query.
            data: Body of the request; None for none.
            headers: Further headers, sent only with a body.
            allowed: Statuses that count as success, too.
            patience: Seconds to wait for an answer that takes longer than others; None for the
                usual time.

        Returns:
            Status and content of a success, or of an `allowed` status.

        Raises:
            AeroDaaSError: What `ask` raises.
        """
        own = self.headers | (dict(headers or {}) if data is not None else {})
        with self._asked(method, path, data, own, patience) as response:
            answer = read_at_most(response, _MOST_BYTES + 1)
        if len(answer) > _MOST_BYTES:
            raise self.strange(f"its answer is larger than {_MOST_BYTES >> 20} MiB")
        if response.status_code not in allowed:
            self._require_success(response.status_code, answer)
        return response.status_code, answer

    def download(
        self, path: str, target: Path, progress: Callable[[int, int | None], None]
    ) -> None:
        """Write the content of an answer to a file, whole or not at all.

        Args:
            path: Of the resource.
            target: The file, which is replaced.
            progress: Called with the bytes that are there, and all of them if that is known.

        Raises:
            AeroDaaSError: As `ask`; UnreachableError also if the answer breaks off.
            OSError: If the file cannot be written.
        """
        with self._asked("GET", path, None, self.headers) as response:
            if response.status_code != HTTPStatus.OK:
                answer = read_at_most(response, _MOST_BYTES)
                self._require_success(response.status_code, answer)
            known = response.headers.get("Content-Length", "")
            size, done = int(known) if known.isdigit() else None, 0
            target.parent.mkdir(parents=True, exist_ok=True)
            part = target.with_name(f"{target.name}.part")
            try:
                with part.open("wb") as file:
                    for chunk in response.iter_raw():
                        file.write(chunk)
                        done += len(chunk)
                        progress(done, size)
                part.replace(target)
            finally:
                part.unlink(missing_ok=True)

    def unreachable(self, error: Exception) -> UnreachableError:
        """The error of a service that does not answer."""
        text = printable(str(error))[:_MOST_TEXT] or type(error).__name__
        return UnreachableError(f"the provider at {self.address.base} does not answer: {text}")

    def strange(self, why: str) -> MissionError:
        """The error of a service that answers otherwise than agreed."""
        return MissionError(
            f"the provider at {self.address.base} does not answer as agreed: {why}; is it "
            "`aerodaas serve` of this version?"
        )

    def refusal(self, status: int, answer: bytes) -> AeroDaaSError:
        """The error of a refusal, with the text of its answer.

        Args:
            status: HTTP status of the answer.
            answer: Content of the answer.

        Returns:
            UnreachableError for a gateway's status, ConfigError for a refused request, else
            MissionError.
        """
        text = _text(answer) or f"it answered with status {status}"
        if status in _GATEWAYS:
            return self.unreachable(ConnectionError(text))
        hint = _LOGIN if status == HTTPStatus.UNAUTHORIZED else ""
        kind = ConfigError if status in _CALLERS else MissionError
        return kind(f"{self.address.host}: {text}{hint}")

    @contextmanager
    def _asked(
        self,
        method: Method,
        path: str,
        data: bytes | None,
        headers: Mapping[str, str],
        patience: float | None = None,
    ) -> Iterator[httpx.Response]:
        """Yield an answer whose content is to be read; raise UnreachableError without one."""
        timeout = httpx.USE_CLIENT_DEFAULT if patience is None else patience
        with http_errors(self.unreachable):
            request = self._client.build_request(
                method, f"{self.address.base}{path}", content=data, headers=headers, timeout=timeout
            )
            with closing(self._answer(request)) as response:
                yield response

    def _answer(self, request: httpx.Request) -> httpx.Response:
        try:
            return self._client.send(request, stream=True)
        except _CUT:
            # A server may close an idle connection at the moment that it is used. What may have
            # changed something is not sent again.
            if request.method not in _REPEATABLE:
                raise
            return self._client.send(request, stream=True)

    def _require_success(self, status: int, answer: bytes) -> None:
        if not HTTPStatus.OK <= status < HTTPStatus.MULTIPLE_CHOICES:
            raise self.refusal(status, answer)


def _text(answer: bytes) -> str:
    try:
        return printable(str(json.loads(answer)["text"]))[:_MOST_TEXT]
    except (ValueError, KeyError, TypeError, RecursionError):
        return ""


def printed(content: Any) -> Any:  # noqa: ANN401 - JSON
    """JSON of another's with texts that are safe for a terminal."""
    if isinstance(content, str):
        return printable(content)
    if isinstance(content, list):
        return [printed(one) for one in content]
    if isinstance(content, dict):
        return {printable(key): printed(one) for key, one in content.items()}
    return content


_FIRST_PAUSE = 0.5
_LONGEST_PAUSE = 10.0
"""Seconds between two attempts to connect again."""


def pauses() -> Iterator[float]:
    """Yield pauses between attempts: doubled each time, and spread, so that clients do not meet."""
    pause = _FIRST_PAUSE
    while True:
        yield pause * random.uniform(0.5, 1.0)
        pause = min(2.0 * pause, _LONGEST_PAUSE)
