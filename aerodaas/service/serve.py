"""Serving: the database, the first token, and the port."""

from __future__ import annotations

import socket
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.loading import link_of
from aerodaas.errors import ConfigError, SourceError
from aerodaas.http_server.addresses import is_loopback, listen
from aerodaas.service.access.accounts import Accounts
from aerodaas.service.http.limits import PROVIDER
from aerodaas.service.http.server import web_server
from aerodaas.service.provider import build_service
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Store

__all__ = ["serve"]


def serve(
    settings: ServiceSettings,
    *,
    host: str = "127.0.0.1",
    port: int = 8400,
    database: str | None = None,
    certificate: Path | None = None,
    key: Path | None = None,
    tell: Callable[[str], None] = print,
) -> None:
    """Serve until Ctrl-C or SIGTERM; flights under way go on without the service.

    Args:
        settings: Of the provider.
        host: Address to listen on; beyond the loopback interface a certificate is compulsory.
        port: Port; 0 for any free one.
        database: URL instead of the file in the state folder.
        certificate: File of the TLS certificate, with its chain.
        key: File of its key.
        tell: Tells the provider's people of what they should know.

    Raises:
        ConfigError: If it would listen to the network without TLS, or two drones share a link.
        SourceError: If the port cannot be had.
        StoreError: If the database cannot be used.
    """
    if certificate is None and not is_loopback(host):
        raise ConfigError(
            f"tokens do not go over a network in the clear: to listen on {host}, give "
            "--certificate and --key, or listen on 127.0.0.1 behind a proxy that has them"
        )
    _require_own_links(settings.config)
    settings.state.mkdir(parents=True, exist_ok=True, mode=0o700)
    settings.state.chmod(0o700)
    listeners = [_bound(host, port)]
    with Store.open(database or settings.state / "service.db") as store:
        token = Accounts(store).first_token()
        if token is not None:
            tell(f"the administrator's token, shown this once: {token}")
        scheme = "https" if certificate is not None else "http"
        where = f"{scheme}://{f'[{host}]' if ':' in host else host}:{_port(listeners[0])}"
        tell(f"serving {settings.config.name} at {where}")
        if settings.agents and certificate is not None:
            # What agents ask goes to the API itself, and the certificate is of another name.
            listeners.append(_bound("127.0.0.1", 0))
        inner = where if certificate is None else f"http://127.0.0.1:{_port(listeners[-1])}"
        web_server(
            build_service(replace(settings, public=settings.public or where), store, tell, inner),
            PROVIDER,
            ssl_certfile=certificate,
            ssl_keyfile=key,
            timeout_graceful_shutdown=2,
        ).run(sockets=listeners)


def _require_own_links(config: EnvironmentConfig) -> None:
    """Raise ConfigError for two drones on one link: they may be flown by different tenants."""
    known: dict[str, str] = {}
    for robot in config.robots:
        link = link_of(robot)
        if link is not None and known.setdefault(link, robot.id) != robot.id:
            raise ConfigError(
                f"robots {known[link]} and {robot.id} share a link, which one flight opens for "
                "itself: a service leases them one by one, so give each a port of its own; a "
                "MAVLink router does that"
            )


def _port(listener: socket.socket) -> int:
    port: int = listener.getsockname()[1]
    return port


def _bound(host: str, port: int) -> socket.socket:
    try:
        return listen(host, port)
    except OSError as error:
        raise SourceError(
            f"cannot listen on {host}:{port}: {error.strerror}; choose another --port"
        ) from None
