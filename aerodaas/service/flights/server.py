"""API of a provider's flight, which its own process serves to the service on this machine."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from aerodaas.analytics.here.relay import HereRelay
from aerodaas.clock import WallOffset
from aerodaas.errors import MissionError
from aerodaas.mission.commands import Answer
from aerodaas.protocol.schemas import Role, SilencePolicy
from aerodaas.service.access.principal import Principal
from aerodaas.service.backend import PilotCommand
from aerodaas.service.flights.orders import FlightOrder
from aerodaas.service.http.limits import LEASED_FLIGHT
from aerodaas.service.http.server import AppServer
from aerodaas.service.own.access import FlightTokens, principal_of
from aerodaas.service.own.flight import FlightRun, OwnFlight
from aerodaas.unix_server import listen_unix

if TYPE_CHECKING:
    from fastapi import FastAPI

__all__ = ["LeaseWatch", "LeasedFlight", "ProcessServer"]

_PERIOD = 0.2
"""Wall seconds between two looks at the clocks."""


class LeaseWatch:
    """Brings the drones home when their lease ends, their mission is cancelled or its user silent.

    It runs beside the drones, so that neither needs the service. Time is monotonic from the order
    on: a clock that is set neither prolongs a lease nor ends it.
    """

    def __init__(
        self,
        order: FlightOrder,
        come_home: Callable[[str], None],
        cancelled: Callable[[], str] = lambda: "",
    ) -> None:
        """Watch over a flight.

        Args:
            order: Of the flight.
            come_home: Called once, with the reason, in another thread.
            cancelled: Tells why the mission is cancelled; empty while it is not.
        """
        self._come_home = come_home
        self._cancelled = cancelled
        self._silence = order.silence
        self._patience = order.silence_seconds
        self._lock = threading.Lock()
        self._heard = time.monotonic()
        self._ends = (order.offset or WallOffset.read()).monotonic(order.ends)
        self._over = threading.Event()
        self.reason = ""
        """Why the drones were called home; empty while the lease is good."""

    def start(self) -> None:
        """Start watching; what is due already is told before this returns."""
        if reason := self._due():
            self.end(reason)
            return
        threading.Thread(target=self._watch, name="lease", daemon=True).start()

    def stop(self) -> None:
        """Stop watching."""
        self._over.set()

    def record_presence(self) -> None:
        """Record that the user has been heard of."""
        with self._lock:
            self._heard = time.monotonic()

    def extend(self, ends: float) -> bool:
        """Move the end of the lease to `ends`, Unix seconds; False once it is over."""
        with self._lock:
            if self.reason:
                return False
            self._ends = WallOffset.read().monotonic(ends)
            return True

    def end(self, reason: str) -> None:
        """End the lease now: it was revoked, or the mission cancelled."""
        with self._lock:
            if self.reason:
                return
            self.reason = reason
        self._come_home(reason)

    def _watch(self) -> None:
        while not self._over.wait(_PERIOD):
            if reason := self._due():
                self.end(reason)
                return

    def _due(self) -> str:
        if cancelled := self._cancelled():
            return cancelled
        with self._lock:
            now = time.monotonic()
            if now >= self._ends:
                return "the lease has ended"
            if self._silence is SilencePolicy.RETURN and now - self._heard > self._patience:
                return f"nothing was heard of the user for {self._patience:g} s"
            return ""


class LeasedFlight(OwnFlight):
    """A flight under a lease: once that is over, its drones obey operators alone.

    It is looked at whoever watches, for its status is the service's and its outcome's.
    """

    def __init__(self, run: FlightRun, name: str, lease: LeaseWatch) -> None:
        """Show `run`, a mission called `name`, under a lease."""
        self._lease = lease
        super().__init__(run, name)

    def fly(self, principal: Principal, mission: str, command: PilotCommand) -> Answer:
        """As `OwnFlight.fly`; once the lease is over, an operator's command alone is given."""
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
        from aerodaas.service.http.gate import Admission  # noqa: PLC0415
        from aerodaas.service.own.server import flight_app  # noqa: PLC0415

        # Whoever can open the socket is the service; it names the role as which it asks.
        roles = {role.value: principal_of(role.value, role) for role in Role}
        admission = Admission(FlightTokens(roles))
        own = FlightRoutes(self._flight, self._lease, self._relay, admission).router()
        return flight_app(self._flight, admission, [own], limits=LEASED_FLIGHT)
