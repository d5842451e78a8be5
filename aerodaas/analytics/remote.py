"""RemoteAnalytics: opens the API of a flight to a remote user."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, ClassVar

from aerodaas.analytics.base import Context, NavigableAnalytics, ResourceUse
from aerodaas.config.checked import checked
from aerodaas.config.extras import require_extra
from aerodaas.config.model import RemoteConfig
from aerodaas.errors import ConfigError
from aerodaas.http_server.addresses import is_loopback

__all__ = ["TOKEN_VARIABLE", "RemoteAnalytics"]

TOKEN_VARIABLE = "AERODAAS_REMOTE_TOKEN"  # noqa: S105 - a name, not a secret
"""Environment variable of the token, for the application and its clients."""


class RemoteAnalytics(NavigableAnalytics):
    """Opens the flight's API on the network: waypoints in, commands in, state and pictures out.

    The application's own process serves the API while it flies. Analyse any stream of the robot, or
    `instantiate`. The stream of this analysis is navigation: `scheduler.add_navigation(…)` says by
    which priority, deadline and order a remote user's waypoints are flown. Clients are `aerodaas
    remote` and `aerodaas.environment.remote_client.RemoteClient`.
    """

    rate = 1.0
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
        """Configure the API; the environment variable `AERODAAS_REMOTE_TOKEN` sets the token.

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
        self.settings = checked(RemoteConfig, asked, "remote")
        if self.settings.token is None and not is_loopback(self.settings.host):
            raise ConfigError(
                f"remote control does not listen on {self.settings.host} without a token: set "
                f"{TOKEN_VARIABLE}, or remote.token in the environment file"
            )

    def process(self, item: object, context: Context) -> None:
        """Do nothing: waypoints arrive by the API."""
