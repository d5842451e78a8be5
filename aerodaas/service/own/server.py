"""Servers of the API beside one's own flight, in a thread of the application's process."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fastapi import APIRouter, FastAPI
from starlette.types import ASGIApp
from typing_extensions import Self

from aerodaas.config.model import RemoteConfig
from aerodaas.errors import ConfigError
from aerodaas.http_server.addresses import HostGuard, listen
from aerodaas.protocol.schemas import Role
from aerodaas.service.app import build_app
from aerodaas.service.http.gate import Admission
from aerodaas.service.http.limits import OWN_FLIGHT, RequestLimits
from aerodaas.service.http.server import AppServer
from aerodaas.service.own.access import REMOTE, FlightTokens, new_tokens, principal_of
from aerodaas.service.own.flight import OwnFlight
from aerodaas.service.routes.fleet import FleetRoutes
from aerodaas.service.routes.live import LiveRoutes
from aerodaas.service.routes.missions import MissionRoutes, PilotingRoutes, extension_routers

__all__ = ["ApiServer", "FlightServer", "flight_app"]


class ApiServer(AppServer):
    """Serves the API and its page to who has a token, until it is closed."""

    def __init__(
        self,
        address: str,
        option: str,
        tokens: FlightTokens | None = None,
        guard: Callable[[ASGIApp, str], ASGIApp] = HostGuard,
    ) -> None:
        """Listen.

        Args:
            address: `host:port`; port 0 selects a free one.
            option: The option that has it, for the error's text.
            tokens: Tokens that are good; None for new ones, of who flies and of who watches.
            guard: Makes what stands before the application, which listens at a host.

        Raises:
            ConfigError: If it cannot be listened on.
        """
        host, _, port = address.rpartition(":")
        self._host = host
        try:
            listener = listen(host.strip("[]"), int(port))
        except (OSError, OverflowError, ValueError) as error:
            raise ConfigError(
                f"cannot serve the flight at {address}: {error}; give another {option}"
            ) from None
        super().__init__(listener, OWN_FLIGHT)
        self._port = listener.getsockname()[1]
        self._tokens = tokens or FlightTokens(new_tokens())
        self._guard = guard

    def address(self, *, viewer: bool = False) -> str:
        """Where a browser opens the page, with the token of who flies, or of who watches only.

        The token stands in the fragment, which a browser sends to nobody.
        """
        host = "127.0.0.1" if self._host in {"0.0.0.0", "[::]"} else self._host  # noqa: S104 - compared
        token = self._tokens.token(Role.VIEWER if viewer else Role.PILOT)
        return f"http://{host}:{self._port}/#token={token}"

    def serve(self, build: Callable[[Admission], FastAPI], alert: Callable[[str], None]) -> None:
        """Serve what `build` makes, in a thread.

        Args:
            build: Makes the application.
            alert: Alerts people of many wrong tokens.
        """
        self._tokens.alert = alert
        app = build(Admission(self._tokens))
        self.start(lambda: self._guard(app, self._host))


class FlightServer(ApiServer):
    """Serves the API of one flight until it is closed."""

    framed = False
    """Whether a page of this machine, such as a notebook, may hold the page in a frame."""

    @classmethod
    def of_remote(cls, settings: RemoteConfig) -> Self:
        """Listen for a remote user, who has the one token of `settings`.

        Without one, which is for loopback only, programs of this machine need none.
        """
        host = f"[{settings.host}]" if ":" in settings.host else settings.host
        what, user = "remote control", principal_of(REMOTE, Role.PILOT)
        if settings.token is None:
            tokens = FlightTokens({}, what, anybody=user)
            guard: Callable[[ASGIApp, str], ASGIApp] = _without_pages
        else:
            remedy = "send it as `Authorization: Bearer …`"
            tokens = FlightTokens({settings.token.get_secret_value(): user}, what, remedy)
            guard = _by_any_name
        return cls(f"{host}:{settings.port}", "remote.port", tokens, guard)

    def show(self, flight: OwnFlight) -> None:
        """Serve a flight that has begun."""
        self.serve(
            lambda admission: flight_app(flight, admission, framed=self.framed),
            lambda text: flight.publish_alert("wrong_tokens", text),
        )


def flight_app(
    flight: OwnFlight,
    admission: Admission,
    further: Sequence[APIRouter] = (),
    *,
    limits: RequestLimits = OWN_FLIGHT,
    framed: bool = False,
) -> FastAPI:
    """Build the application of one flight.

    Args:
        flight: The flight.
        admission: Who may ask for what.
        further: Further routes.
        limits: Limits of requests.
        framed: As of `build_app`.
    """
    routes = (
        FleetRoutes(flight, admission),
        MissionRoutes(flight, admission),
        PilotingRoutes(flight, admission),
        LiveRoutes(flight, admission),
    )
    return build_app(
        admission,
        [
            *further,
            *extension_routers(flight, admission),
            *(one.router() for one in routes),
        ],
        limits=limits,
        tiles=flight.config.map_tiles,
        framed=framed,
    )


def _without_pages(app: ASGIApp, host: str) -> ASGIApp:
    """A guard that keeps all web pages out, for they need no token."""
    return HostGuard(app, host, pages=False)


def _by_any_name(app: ASGIApp, host: str) -> ASGIApp:
    """No guard: who has the token may address the host by any name."""
    del host
    return app
