"""Servers of the API beside one's own flight, in a thread of the application's process."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from fastapi import FastAPI

from aerodaas.errors import ConfigError
from aerodaas.http_server.addresses import HostGuard, listen
from aerodaas.http_server.server import web_server
from aerodaas.protocol.schemas import Role
from aerodaas.service.app import build_app
from aerodaas.service.http.admission import Admission
from aerodaas.service.http.gate import Bounds
from aerodaas.service.own.access import FlightTokens, new_tokens
from aerodaas.service.own.flight import Flown, OwnFlight
from aerodaas.service.routes.fleet import FleetRoutes
from aerodaas.service.routes.live import LiveRoutes
from aerodaas.service.routes.missions import MissionRoutes, PilotingRoutes

__all__ = ["ConsoleServer", "PageServer"]

_STOPPING = 5.0
_FAREWELL = 1.0
"""Wall seconds in which watchers are told that the flight is over."""
_MOST_CONNECTIONS = 640
"""A page has two that stay, and a few that come and go."""
_MOST_WATCHERS = 320
"""Live views by the token of who watches only, which many may share."""
_MOST_BYTES_SENT = 4096
"""Bytes of a WebSocket message; watchers have nothing to say."""
_PING_SECONDS = 5.0


class PageServer:
    """Serves the API and its page to who has a token, until it is closed."""

    def __init__(self, address: str, option: str) -> None:
        """Listen.

        Args:
            address: `host:port`; port 0 selects a free one.
            option: The option that has it, for the error's text.

        Raises:
            ConfigError: If it cannot be listened on.
        """
        host, _, port = address.rpartition(":")
        self._host = host
        try:
            self._socket = listen(host.strip("[]"), int(port))
        except (OSError, OverflowError, ValueError) as error:
            raise ConfigError(
                f"cannot serve the console at {address}: {error}; give another {option}"
            ) from None
        self._tokens = new_tokens()
        self._thread: threading.Thread | None = None

    def address(self, *, viewer: bool = False) -> str:
        """Where a browser opens the page, with the token of who flies, or of who watches only.

        The token stands in the fragment, which a browser sends to nobody.
        """
        host = "127.0.0.1" if self._host in {"0.0.0.0", "[::]"} else self._host  # noqa: S104 - compared
        role = Role.VIEWER if viewer else Role.PILOT
        token = next(one for one, its_role in self._tokens.items() if its_role is role)
        return f"http://{host}:{self._socket.getsockname()[1]}/#token={token}"

    def serve(self, build: Callable[[Admission], FastAPI], tell: Callable[[str], None]) -> None:
        """Serve what `build` makes, in a thread; `tell` tells people of many wrong tokens."""
        app = build(Admission(FlightTokens(self._tokens, tell)))
        self._server = web_server(
            HostGuard(app, self._host),
            most_connections=_MOST_CONNECTIONS,
            timeout_graceful_shutdown=1,
            ws_max_size=_MOST_BYTES_SENT,
            # It would compress each picture anew for each watcher, and pictures are compressed.
            ws_per_message_deflate=False,
            ws_ping_interval=_PING_SECONDS,
            ws_ping_timeout=_PING_SECONDS,
        )
        words = {"sockets": [self._socket]}
        self._thread = threading.Thread(
            target=self._server.run, kwargs=words, name="console server", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        if self._thread is not None:
            self._server.should_exit = True
            self._thread.join(_STOPPING)
        self._socket.close()


class ConsoleServer(PageServer):
    """Serves the API of one flight until it is closed."""

    def __init__(self, address: str, *, framed: bool = False) -> None:
        """Listen at `host:port`; raises ConfigError if that cannot be listened on.

        `framed`: a page of this machine, such as a notebook, may hold it in a frame.
        """
        super().__init__(address, "--console-address")
        self._framed = framed
        self._flight: OwnFlight | None = None

    def start(self, run: Flown, name: str) -> None:
        """Show a flight that has begun, an application called `name`."""
        flight = self._flight = OwnFlight(run, name)

        def build(admission: Admission) -> FastAPI:
            routes = (
                FleetRoutes(flight, admission),
                MissionRoutes(flight, admission),
                PilotingRoutes(flight, admission),
                LiveRoutes(flight, admission),
            )
            return build_app(
                admission,
                [one.router() for one in routes],
                bounds=Bounds(reserved=Role.PILOT, lasting=_MOST_WATCHERS),
                tiles=run.config.map_tiles,
                framed=self._framed,
            )

        self.serve(build, lambda text: run.note("console_wrong_tokens", text))

    def close(self) -> None:
        """Tell the watchers that the flight is over, and stop serving."""
        if self._flight is not None:
            self._flight.close()
            time.sleep(_FAREWELL)
        super().close()
