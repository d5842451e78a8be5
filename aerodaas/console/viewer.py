"""The console of a recording: the page, and the service's routes for the one flight in a file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fastapi import APIRouter, Response

from aerodaas.console.app import account_of, build_page, require_known
from aerodaas.console.own_flight import OWN
from aerodaas.console.playback import Moment, Player, Stream, flight_answer, picture_answer
from aerodaas.console.server import PageServer
from aerodaas.protocol.schemas import FleetOut, MissionOut, MissionPhase
from aerodaas.recording.reader import Recording
from aerodaas.types.clock import seconds

__all__ = ["RecordingServer"]


class RecordingServer(PageServer):
    """Serves the page for one recording until it is closed."""

    def __init__(
        self, address: str, recording: Recording, tell: Callable[[str], None] = lambda _: None
    ) -> None:
        """Listen, and show a recording.

        Args:
            address: `host:port`; port 0 selects a free one.
            recording: An open recording, which is closed at the end.
            tell: Tells people of many wrong tokens.

        Raises:
            ConfigError: If it cannot be listened on.
        """
        super().__init__(address, "--address")
        self._player = Player(recording.path, recording)
        routes = _Routes(recording, self._player).router()
        self.serve(build_page(routes), tell)

    def close(self) -> None:
        """Stop serving, and close the recording."""
        super().close()
        self._player.close()


class _Routes:
    """The service's routes that the page asks, with the same answers."""

    def __init__(self, recording: Recording, player: Player) -> None:
        self._player = player
        name = recording.provenance.get("name") or recording.path.stem
        began = seconds(recording.epoch_ns)
        self._mission = MissionOut(
            id=OWN,
            name=name,
            tenant=OWN,
            account=OWN,
            phase=MissionPhase.LANDED,
            robots=[],
            submitted=began,
            started=began,
            recording=True,
        )

    def router(self) -> APIRouter:
        """The routes."""
        router = APIRouter(prefix="/v1")
        router.add_api_route("/me", account_of)
        router.add_api_route("/fleet", self.fleet)
        router.add_api_route("/missions", self.missions)
        bare: dict[str, Any] = {"response_model": None}
        router.add_api_route("/missions/{mission}/playback", self.flight, **bare)
        router.add_api_route("/missions/{mission}/playback/picture", self.picture, **bare)
        return router

    def fleet(self) -> FleetOut:
        """Nothing: where it was flown stands in the recording."""
        return FleetOut(name=self._mission.name, robots=[], environment={})

    def missions(self) -> list[MissionOut]:
        """The one flight."""
        return [self._mission]

    def flight(self, mission: str) -> Response:
        """How far the recording has been read, and the flight once it was."""
        require_known(mission)
        return flight_answer(self._player)

    def picture(self, mission: str, stream: Stream, at: Moment) -> Response:
        """The last picture of a stream captured at or before a mission time, in nanoseconds."""
        require_known(mission)
        return picture_answer(self._player, stream, at)
