"""The API over recordings: the page, and the flights in some files."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fastapi import FastAPI

from aerodaas.clock import seconds
from aerodaas.messages.health import HealthReport
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import AccountOut, FleetOut, MissionOut, MissionPhase
from aerodaas.recording.reader import Recording
from aerodaas.service.access.principal import Principal
from aerodaas.service.app import build_app
from aerodaas.service.errors import RefusedError
from aerodaas.service.http.gate import Admission
from aerodaas.service.http.limits import OWN_FLIGHT
from aerodaas.service.live.playback import Player
from aerodaas.service.own.access import OWN, account_of
from aerodaas.service.own.server import ApiServer
from aerodaas.service.routes.fleet import FleetRoutes
from aerodaas.service.routes.missions import MissionRoutes
from aerodaas.service.routes.playback import PlaybackRoutes

__all__ = ["RecordingServer"]


class RecordingServer(ApiServer):
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
        self._flights = flights = _RecordedFlights(recordings)

        def build(admission: Admission) -> FastAPI:
            routes = (
                FleetRoutes(flights, admission),
                MissionRoutes(flights, admission),
                PlaybackRoutes(flights.player, admission),
            )
            return build_app(admission, [one.router() for one in routes], limits=OWN_FLIGHT)

        self.serve(build, tell)

    def address_of(self, moment: float | None = None) -> str:
        """The page with its token, at a mission time in seconds; two recordings side by side."""
        address = self.address(viewer=True)
        if moment is not None:
            address += f"&t={moment:g}"
        if self._flights.several:
            address += f"&mission={_name(0)}&beside={_name(1)}"
        return address

    def close(self) -> None:
        """Stop serving, and close the recordings."""
        super().close()
        self._flights.close()


class _RecordedFlights:
    """Recordings as missions that are over, without a fleet: what was flown stands in each."""

    def __init__(self, recordings: Sequence[Recording]) -> None:
        self._missions = {
            _name(place): _mission(_name(place), one) for place, one in enumerate(recordings)
        }
        self._players = {
            _name(place): Player(one.path, one) for place, one in enumerate(recordings)
        }

    @property
    def several(self) -> bool:
        return len(self._players) > 1

    def close(self) -> None:
        for player in self._players.values():
            player.close()

    def account(self, principal: Principal) -> AccountOut:
        return account_of(principal)

    def seen_by(self, principal: Principal) -> FleetOut:
        del principal
        return FleetOut(name=self._missions[OWN].name, robots=[], environment={})

    def fleet_scenery(self) -> SceneryOut:
        return SceneryOut()

    def preflight(self, robot: str) -> HealthReport:
        raise RefusedError(404, f"there is no robot {robot}")

    def missions(self, principal: Principal) -> list[MissionOut]:
        del principal
        return list(self._missions.values())

    def mission(self, principal: Principal, mission: str) -> MissionOut:
        del principal
        self._require(mission)
        return self._missions[mission]

    def scenery(self, principal: Principal, mission: str) -> SceneryOut:
        del principal
        self._require(mission)
        return SceneryOut()

    def player(self, principal: Principal, mission: str) -> Player:
        del principal
        self._require(mission)
        return self._players[mission]

    def _require(self, mission: str) -> None:
        if mission not in self._missions:
            known = ", ".join(self._missions)
            raise RefusedError(404, f"there is no mission {mission}: there is {known}")


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
