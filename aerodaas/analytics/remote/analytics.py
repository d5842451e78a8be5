"""RemoteAnalytics: monitoring and control of the mission over the network."""

from __future__ import annotations

import itertools
import os
import socket
import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pydantic import ValidationError

from aerodaas.analytics.base import Context, ResourceUse
from aerodaas.analytics.commanding import CommandingAnalytics, MissionLink
from aerodaas.analytics.remote.client import TOKEN_VARIABLE
from aerodaas.config.extras import require_extra
from aerodaas.config.model import RemoteConfig
from aerodaas.errors import ConfigError, SourceError
from aerodaas.http_server.addresses import Guard, is_loopback, listen
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.readings import Alert

if TYPE_CHECKING:
    import uvicorn

__all__ = ["RemoteAnalytics"]

_STOPPING = 5.0
_MOST_CONNECTIONS = 200
_MOST_BYTES_SENT = 4096
"""Bytes of a WebSocket message; clients of the status have nothing to say."""


def _alerting(mission: MissionLink) -> Callable[[str], None]:
    """What tells people of a text by the mission's alerts."""
    numbers = itertools.count()

    def tell(text: str) -> None:
        status = mission.status()
        header = Header(next(numbers), status.stamp if status else 0, "remote")
        mission.alert(Alert(header, "remote_wrong_tokens", text))

    return tell


class RemoteAnalytics(CommandingAnalytics):
    """Serves HTTP and WebSocket while the mission runs: waypoints in, commands in, state out.

    Analyse a camera's stream to serve its newest image, or `instantiate` without a camera. The
    stream of this analysis is navigation: without `scheduler.add_navigation(…)`, waypoints are
    refused. Clients are `aerodaas remote` and `aerodaas.analytics.remote.client.RemoteClient`.
    """

    isolated = True
    rate = 20.0
    resources: ClassVar[Mapping[str, ResourceUse]] = dict.fromkeys(
        ("env_data", "host", "port"), "environment"
    )

    def __init__(
        self,
        env_data: Mapping[str, Any] | None = None,
        *,
        host: str | None = None,
        port: int | None = None,
    ) -> None:
        """Configure the service; the environment variable `AERODAAS_REMOTE_TOKEN` sets the token.

        Args:
            env_data: `Environment.env_data`, whose section `remote` holds the settings.
            host: Address to listen on; overrides the section.
            port: Port to listen on; overrides the section.

        Raises:
            ConfigError: If a setting is invalid, or the address is reachable from other machines
                without a token, so that anyone on the network could command the drone; or if the
                packages of the extra `remote` are missing.
        """
        require_extra("remote", type(self).__name__)
        asked = dict((env_data or {}).get("remote", {}))
        asked |= {"host": host} if host is not None else {}
        asked |= {"port": port} if port is not None else {}
        asked |= {"token": value} if (value := os.environ.get(TOKEN_VARIABLE)) else {}
        try:
            self._settings = RemoteConfig.model_validate(asked)
        except ValidationError as error:
            # The error's own text repeats its input, which may hold the token.
            said = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
            raise ConfigError(f"remote: {said}") from None
        if self._settings.token is None and not is_loopback(self._settings.host):
            raise ConfigError(
                f"remote control does not listen on {self._settings.host} without a token: set "
                f"{TOKEN_VARIABLE}, or remote.token in the environment file"
            )
        self._frame: Frame | None = None
        self._socket: socket.socket | None = None
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None

    def open(self) -> None:
        """Bind the port.

        Raises:
            SourceError: If the port cannot be bound.
        """
        host, port = self._settings.host, self._settings.port
        try:
            self._socket = listen(host, port)
        except OSError as error:
            raise SourceError(
                f"remote control cannot listen on {host}:{port}: {error.strerror}; "
                "choose another remote.port in the environment file"
            ) from None

    def begin(self, mission: MissionLink) -> None:
        """Start the server in a thread."""
        from aerodaas.analytics.remote.app import build_app  # noqa: PLC0415 - only in the actor
        from aerodaas.http_server.server import web_server  # noqa: PLC0415

        assert self._socket is not None  # noqa: S101 - open came first
        token = self._settings.token.get_secret_value() if self._settings.token else None
        app = Guard(build_app(mission, lambda: self._frame), token, _alerting(mission))
        self._server = web_server(
            app,
            most_connections=_MOST_CONNECTIONS,
            lifespan="off",
            timeout_graceful_shutdown=1,
            ws_max_size=_MOST_BYTES_SENT,
        )
        self._thread = threading.Thread(
            target=self._server.run,
            kwargs={"sockets": [self._socket]},
            name="remote control",
            daemon=True,
        )
        self._thread.start()

    def process(self, item: object, context: Context) -> None:  # noqa: ARG002 - the base's
        """Store the newest frame for `/frame.jpg`."""
        if isinstance(item, Frame):
            # A copy, so that the frame's shared memory is free for the next ones.
            self._frame = Frame(item.header, np.array(item.image))

    def close(self) -> None:
        """Stop serving."""
        if self._server is not None and self._thread is not None:
            self._server.should_exit = True
            self._thread.join(_STOPPING)
        if self._socket is not None:
            self._socket.close()
