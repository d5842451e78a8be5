"""Server of the console beside one's own flight, in a thread of the application's process."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from starlette.types import ASGIApp

from aerodaas.analytics.remote.attempts import WrongTokens
from aerodaas.analytics.remote.guard import HostGuard
from aerodaas.analytics.remote.listening import listen
from aerodaas.analytics.remote.serving import web_server
from aerodaas.console.access import FlightKeys, TokenGuard
from aerodaas.console.app import build_console
from aerodaas.console.own_flight import Flown, OwnFlight
from aerodaas.errors import ConfigError

__all__ = ["ConsoleServer", "PageServer"]

_STOPPING = 5.0
_FAREWELL = 1.0
"""Wall seconds in which watchers are told that the flight is over."""
_MOST_CONNECTIONS = 640
"""A page has two that stay, and a few that come and go."""
_MOST_BYTES_SENT = 4096
"""Bytes of a WebSocket message; watchers have nothing to say."""
_PING_SECONDS = 5.0


class PageServer:
    """Serves the page to who has a token, until it is closed."""

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
        self._keys = FlightKeys()
        self._thread: threading.Thread | None = None

    def address(self, *, viewer: bool = False) -> str:
        """Where a browser opens the page, with the token of who flies, or of who watches only.

        The token stands in the fragment, which a browser sends to nobody.
        """
        host = "127.0.0.1" if self._host in {"0.0.0.0", "[::]"} else self._host  # noqa: S104 - compared
        token = self._keys.viewer if viewer else self._keys.pilot
        return f"http://{host}:{self._socket.getsockname()[1]}/#token={token}"

    def serve(self, app: ASGIApp, tell: Callable[[str], None]) -> None:
        """Serve an application, in a thread; `tell` tells people of many wrong tokens."""
        guarded = TokenGuard(app, self._keys, WrongTokens(tell, what="the console"))
        self._server = web_server(
            HostGuard(guarded, self._host),
            most_connections=_MOST_CONNECTIONS,
            lifespan="off",
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
    """Serves the page for one flight until it is closed."""

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
        app = build_console(flight, run.config, framed=self._framed)
        self.serve(app, lambda text: run.note("console_wrong_tokens", text))

    def close(self) -> None:
        """Tell the watchers that the flight is over, and stop serving."""
        if self._flight is not None:
            self._flight.close()
            time.sleep(_FAREWELL)
        super().close()
