"""The API of a provider's flight, served by its own process to the service on this machine."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import TYPE_CHECKING

from aerodaas.analytics.here.relay import LARGEST_ANSWER, HereRelay
from aerodaas.errors import MissionError
from aerodaas.protocol.schemas import AnswerOut, Role
from aerodaas.service.access.principal import Principal
from aerodaas.service.access.rates import RateLimiter
from aerodaas.service.backend import PilotCommand
from aerodaas.service.flights.watch import LeaseWatch
from aerodaas.service.own.access import FlightTokens, principal_of
from aerodaas.service.own.flight import Flown, OwnFlight
from aerodaas.unix_server import listen_unix

if TYPE_CHECKING:
    import uvicorn

__all__ = ["LeasedFlight", "ProcessServer"]

_MOST_CONNECTIONS = 256
_MOST_WATCHING = 48
"""Connections that last of viewers, and of pilots: a mission's users open them. The service has the
rest to command and follow, or whoever watches much could keep an operator from recalling a drone.
"""
_RATE = 10_000.0
"""Requests a second, on average: the service has counted its users' own."""
_MOST_MESSAGE = LARGEST_ANSWER + (64 << 10)
"""Bytes of a WebSocket message, see `service.serve`."""
_STOPPING = 5.0


class LeasedFlight(OwnFlight):
    """A flight under a lease: once that is over, its drones obey operators alone.

    It is looked at whoever watches, for its status is the service's and its outcome's.
    """

    def __init__(self, run: Flown, name: str, lease: LeaseWatch) -> None:
        """Show `run`, a mission called `name`, under a lease."""
        self._lease = lease
        super().__init__(run, name)

    def fly(self, principal: Principal, mission: str, command: PilotCommand) -> AnswerOut:
        """Give a robot a command, unless the lease is over; raises AeroDaaSError."""
        if self._lease.reason and not principal.role.reaches(Role.OPERATOR):
            return self.refusal()
        return super().fly(principal, mission, command)

    def refusal(self) -> AnswerOut:
        """Answer to who may not do anything any more, for the lease is over."""
        return AnswerOut(accepted=False, text=f"the drones come home: {self._lease.reason}")

    @property
    def _watched(self) -> bool:
        return True


class ProcessServer:
    """Serves one flight on a Unix socket until it is closed, in a thread of its own."""

    def __init__(
        self, path: Path, flight: LeasedFlight, lease: LeaseWatch, relay: HereRelay
    ) -> None:
        """Listen at the socket `path`; raises MissionError if that cannot be done."""
        try:
            self._socket = listen_unix(path)
        except OSError as error:
            raise MissionError(f"there is no socket at {path}: {error}") from None
        self._flight, self._lease, self._relay = flight, lease, relay
        self._closed = threading.Event()
        self._server: uvicorn.Server | None = None
        self._thread = threading.Thread(target=self._serve, name="flight server", daemon=True)

    def start(self) -> None:
        """Serve from now on; who has connected before is answered then."""
        self._thread.start()

    def close(self) -> None:
        """Tell who watches that the flight is over, and stop serving."""
        self._closed.set()
        if self._server is not None:
            self._server.should_exit = True
        self._thread.join(_STOPPING)
        self._socket.close()

    def _serve(self) -> None:
        # FastAPI takes a while to load, in which the flight is launched.
        from aerodaas.http_server.server import web_server  # noqa: PLC0415
        from aerodaas.service.flights.routes import FlightRoutes  # noqa: PLC0415
        from aerodaas.service.http.admission import Admission  # noqa: PLC0415
        from aerodaas.service.http.gate import Bounds  # noqa: PLC0415
        from aerodaas.service.own.server import flight_app  # noqa: PLC0415

        # Whoever can open the socket is the service; it names the role as which it asks.
        roles = {role.value: principal_of(role.value, role) for role in Role}
        admission = Admission(FlightTokens(roles), rates=RateLimiter(_RATE, _RATE))
        own = FlightRoutes(self._flight, self._lease, self._relay, admission).router()
        self._server = web_server(
            flight_app(self._flight, admission, [own], bounds=Bounds(lasting=_MOST_WATCHING)),
            most_connections=_MOST_CONNECTIONS,
            timeout_graceful_shutdown=1,
            ws_max_size=_MOST_MESSAGE,
            ws_per_message_deflate=False,
            ws_ping_interval=None,
        )
        if not self._closed.is_set():
            self._server.run(sockets=[self._socket])
