"""The API of a provider's flight, served by its own process to the service on this machine."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerodaas.analytics.here.relay import HereRelay
from aerodaas.errors import MissionError
from aerodaas.mission.commands import Answer
from aerodaas.protocol.schemas import Role
from aerodaas.service.access.principal import Principal
from aerodaas.service.backend import PilotCommand
from aerodaas.service.flights.watch import LeaseWatch
from aerodaas.service.http.app_server import AppServer
from aerodaas.service.http.limits import LEASED_FLIGHT
from aerodaas.service.own.access import FlightTokens, principal_of
from aerodaas.service.own.flight import Flown, OwnFlight
from aerodaas.unix_server import listen_unix

if TYPE_CHECKING:
    from fastapi import FastAPI

__all__ = ["LeasedFlight", "ProcessServer"]


class LeasedFlight(OwnFlight):
    """A flight under a lease: once that is over, its drones obey operators alone.

    It is looked at whoever watches, for its status is the service's and its outcome's.
    """

    def __init__(self, run: Flown, name: str, lease: LeaseWatch) -> None:
        """Show `run`, a mission called `name`, under a lease."""
        self._lease = lease
        super().__init__(run, name)

    def fly(self, principal: Principal, mission: str, command: PilotCommand) -> Answer:
        """Give a robot a command, unless the lease is over; raises AeroDaaSError."""
        if self._lease.reason and not principal.role.reaches(Role.OPERATOR):
            return self.refusal()
        return super().fly(principal, mission, command)

    def refusal(self) -> Answer:
        """Answer to who may not do anything any more, for the lease is over."""
        return Answer(accepted=False, text=f"the drones come home: {self._lease.reason}")

    @property
    def _watched(self) -> bool:
        return True


class ProcessServer(AppServer):
    """Serves one flight on a Unix socket, until it is closed."""

    def __init__(
        self, path: Path, flight: LeasedFlight, lease: LeaseWatch, relay: HereRelay
    ) -> None:
        """Listen at the socket `path`; raises MissionError if that cannot be done."""
        try:
            listener = listen_unix(path)
        except OSError as error:
            raise MissionError(f"there is no socket at {path}: {error}") from None
        super().__init__(listener, LEASED_FLIGHT)
        self._flight, self._lease, self._relay = flight, lease, relay

    def show(self) -> None:
        """Serve the flight from now on."""
        self.start(self._build)

    def _build(self) -> FastAPI:
        # FastAPI takes a while to load, in which the flight is launched.
        from aerodaas.service.flights.routes import FlightRoutes  # noqa: PLC0415
        from aerodaas.service.http.admission import Admission  # noqa: PLC0415
        from aerodaas.service.own.server import flight_app  # noqa: PLC0415

        # Whoever can open the socket is the service; it names the role as which it asks.
        roles = {role.value: principal_of(role.value, role) for role in Role}
        admission = Admission(FlightTokens(roles))
        own = FlightRoutes(self._flight, self._lease, self._relay, admission).router()
        return flight_app(self._flight, admission, [own], limits=LEASED_FLIGHT)
