"""The console of recordings: the page, and the service's routes for the flights in some files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fastapi import APIRouter, HTTPException, Response

from aerodaas.clock import seconds
from aerodaas.console.app import account_of, build_page
from aerodaas.console.own_flight import OWN
from aerodaas.console.playback import Moment, Player, Stream, flight_answer, picture_answer
from aerodaas.console.server import PageServer
from aerodaas.protocol.schemas import FleetOut, MissionOut, MissionPhase
from aerodaas.recording.reader import Recording

__all__ = ["RecordingServer"]


class RecordingServer(PageServer):
    """Serves the page for recordings until it is closed."""

    def __init__(
        self,
        address: str,
        recordings: Sequence[Recording],
        tell: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Listen, and show recordings: the first one, and any other beside it.

        Args:
            address: `host:port`; port 0 selects a free one.
            recordings: Open recordings, which are closed at the end.
            tell: Tells people of many wrong tokens.

        Raises:
            ConfigError: If it cannot be listened on.
        """
        super().__init__(address, "--address")
        self._players = {
            _name(place): Player(one.path, one) for place, one in enumerate(recordings)
        }
        missions = [_mission(_name(place), one) for place, one in enumerate(recordings)]
        self.serve(build_page(_Routes(missions, self._players).router()), tell)

    def address_of(self, moment: float | None = None) -> str:
        """The page with its token, at a mission time in seconds; two recordings side by side."""
        address = self.address(viewer=True)
        if moment is not None:
            address += f"&t={moment:g}"
        if len(self._players) > 1:
            address += f"&mission={_name(0)}&beside={_name(1)}"
        return address

    def close(self) -> None:
        """Stop serving, and close the recordings."""
        super().close()
        for player in self._players.values():
            player.close()


def _name(place: int) -> str:
    """The mission's id that a recording goes by."""
    return OWN if place == 0 else f"{OWN}-{place + 1}"


def _mission(name: str, recording: Recording) -> MissionOut:
    began = seconds(recording.epoch_ns)
    return MissionOut(
        id=name,
        name=recording.provenance.get("name") or recording.path.stem,
        tenant=OWN,
        account=OWN,
        phase=MissionPhase.LANDED,
        robots=[],
        submitted=began,
        started=began,
        recording=True,
    )


class _Routes:
    """The service's routes that the page asks, with the same answers."""

    def __init__(self, missions: list[MissionOut], players: Mapping[str, Player]) -> None:
        self._missions = missions
        self._players = players

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
        return FleetOut(name=self._missions[0].name, robots=[], environment={})

    def missions(self) -> list[MissionOut]:
        """The flights."""
        return self._missions

    def flight(self, mission: str) -> Response:
        """How far the recording has been read, and the flight once it was."""
        return flight_answer(self._player(mission))

    def picture(
        self,
        mission: str,
        stream: Stream,
        at: Moment,
        depth: bool = False,  # noqa: FBT001, FBT002 - of an address
    ) -> Response:
        """The last picture of a stream captured at or before a mission time, in nanoseconds."""
        return picture_answer(self._player(mission), stream, at, depth=depth)

    def _player(self, mission: str) -> Player:
        if mission not in self._players:
            known = ", ".join(self._players)
            raise HTTPException(404, f"there is no mission {mission}: there is {known}")
        return self._players[mission]
