"""Client of the remote control: commands by HTTP, the mission's state by WebSocket."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator, Sequence
from typing import Any
from urllib.parse import urlsplit

from aerodaas.config.extras import require_extra
from aerodaas.errors import ConfigError, MissionError, SourceError, UnreachableError

__all__ = ["TOKEN_VARIABLE", "RemoteClient"]

TOKEN_VARIABLE = "AERODAAS_REMOTE_TOKEN"  # noqa: S105 - a name, not a secret
"""Environment variable of the token, for the service and its clients."""
_TIMEOUT = 10.0
_MALFORMED = {400, 401, 403, 411, 413, 422}


class RemoteClient:
    """Client of a `RemoteAnalytics`.

    >>> client = RemoteClient("http://127.0.0.1:8350")  # doctest: +SKIP
    >>> client.add_waypoints([{"id": "look", "x": 5, "y": 5, "z": 2}])  # doctest: +SKIP
    """

    def __init__(self, url: str, token: str | None = None) -> None:
        """Configure the `url` of the service, such as `http://127.0.0.1:8350`, and its `token`.

        Raises ConfigError for any other form of address.
        """
        parts = urlsplit(url)
        if parts.scheme != "http" or parts.hostname is None:
            raise ConfigError(f"a remote control's address is http://host:port, not {url!r}")
        self._host, self._port = parts.hostname, parts.port or 80
        self._headers = {} if token is None else {"Authorization": f"Bearer {token}"}

    def status(self) -> dict[str, Any]:
        """Return the status of mission and vehicle, with the fields of `schemas.StatusOut`."""
        return self._ask("GET", "/status")

    def add_waypoints(
        self,
        waypoints: Sequence[dict[str, Any]],
        *,
        ordered: bool = True,
        index: int | None = None,
    ) -> dict[str, Any]:
        """Add waypoints, each by the fields of `aerodaas.Waypoint`; returns the mission's answer.

        Raises MissionError if the mission refuses all of them, ConfigError for malformed ones.
        """
        body = {"waypoints": list(waypoints), "ordered": ordered, "index": index}
        return self._ask("POST", "/waypoints", body)

    def command(self, name: str) -> dict[str, Any]:
        """Send `pause`, `resume`, `clear`, `return-home` or `abort`; returns the mission's answer.

        Raises MissionError if the mission refuses.
        """
        return self._ask("POST", f"/{name}")

    def frame(self) -> bytes:
        """Return the camera's newest image as JPEG."""
        status, data = self._exchange("GET", "/frame.jpg", None)
        if status != http.client.OK:
            raise SourceError(_text(data, status))
        return data

    def stream(self, rate: float = 5.0) -> Iterator[dict[str, Any]]:
        """Yield the status `rate` times a second until the mission is over.

        Raises SourceError if the service cannot be reached or refuses.
        """
        require_extra("remote", "the stream of the status")
        from websockets.exceptions import ConnectionClosed, InvalidHandshake  # noqa: PLC0415
        from websockets.sync.client import connect  # noqa: PLC0415 - only to follow

        where = f"[{self._host}]" if ":" in self._host else self._host
        url = f"ws://{where}:{self._port}/stream?rate={rate:g}"
        try:
            with connect(url, additional_headers=self._headers, proxy=None) as socket:
                for text in socket:
                    yield json.loads(text)
        except ConnectionClosed as error:
            raise UnreachableError(f"the remote control broke off: {error}") from None
        except InvalidHandshake as error:
            raise SourceError(f"the remote control refuses: {error}; is the token right?") from None
        except OSError as error:
            raise self._unreachable(error) from None

    def _ask(self, method: str, path: str, body: object = None) -> dict[str, Any]:
        data = None if body is None else json.dumps(body).encode()
        status, answer = self._exchange(method, path, data)
        if status != http.client.OK:
            text = _text(answer, status)
            raise ConfigError(text) if status in _MALFORMED else MissionError(text)
        content: dict[str, Any] = json.loads(answer)
        return content

    def _exchange(self, method: str, path: str, data: bytes | None) -> tuple[int, bytes]:
        headers = self._headers | ({"Content-Type": "application/json"} if data else {})
        connection = http.client.HTTPConnection(self._host, self._port, timeout=_TIMEOUT)
        try:
            connection.request(method, path, data, headers)
            response = connection.getresponse()
            return response.status, response.read()
        except (OSError, http.client.HTTPException) as error:
            raise self._unreachable(error) from None
        finally:
            connection.close()

    def _unreachable(self, error: Exception) -> UnreachableError:
        return UnreachableError(
            f"no remote control answers at {self._host}:{self._port} "
            f"({error or type(error).__name__}): "
            "is the mission flying, and does it use RemoteAnalytics?"
        )


def _text(answer: bytes, status: int) -> str:
    try:
        return str(json.loads(answer)["text"])
    except (ValueError, KeyError, TypeError):
        return f"the remote control answered with status {status}"
