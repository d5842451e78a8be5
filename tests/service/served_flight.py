"""A provider's flight whose drones are a test's own, behind the API of its process."""

from __future__ import annotations

from collections.abc import Callable

from aerodaas.analytics.here.relay import HereRelay
from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.graph import Graph
from aerodaas.errors import MissionError
from aerodaas.mission.commands import Answer, Command
from aerodaas.runtime.reports import FlightState
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.server import LeasedFlight, LeaseWatch, ProcessServer

__all__ = ["Drones", "ServedFlight"]


class Drones:
    """Drones of which nothing is known, and that do what a test says."""

    state = None
    over = False

    def __init__(
        self,
        config: EnvironmentConfig,
        obey: Callable[[str, Command], Answer] = lambda *_: Answer(accepted=True),
    ) -> None:
        self.config = config
        self.graph = Graph([])
        self.obey = obey

    def poll(self, newest: int = 200) -> FlightState:
        """Nothing to be seen."""
        del newest
        raise MissionError("nothing is to be seen")

    def command(self, robot: str, command: Command) -> Answer:
        """Obey."""
        return self.obey(robot, command)

    def publish_alert(self, kind: str, text: str) -> None:
        """Nothing."""


class ServedFlight:
    """A flight in this process, which the service finds by the socket in its folder."""

    def __init__(
        self,
        folder: FlightFolder,
        drones: Drones,
        lease: LeaseWatch,
        make: type[LeasedFlight] = LeasedFlight,
    ) -> None:
        self.relay = HereRelay(folder.path / "here")
        self.flight = make(drones, "m", lease)
        self._server = ProcessServer(folder.socket, self.flight, lease, self.relay)
        self._server.show()

    def close(self) -> None:
        """End the flight."""
        self.flight.end()
        self._server.close()
