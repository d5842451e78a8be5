"""The console of one's own flight: the page, and the service's routes for this one mission."""

from __future__ import annotations

from collections.abc import Sequence

from fastapi import APIRouter, FastAPI, HTTPException, Request, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException as AnyHTTPException
from starlette.requests import HTTPConnection

from aerodaas.analytics.remote.denial import malformed
from aerodaas.analytics.remote.schemas import AnswerOut
from aerodaas.config.map_tiles import MapTilesConfig
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.redaction import catalogue
from aerodaas.console.access import role_of
from aerodaas.console.controls import ControlCommand, ControlSession, told_of_controls
from aerodaas.console.hub import StreamHub
from aerodaas.console.live import Form, LiveSession, Rate, StreamNames, wanted_streams
from aerodaas.console.map_archive import archive_routes
from aerodaas.console.own_flight import OWN, OwnFlight
from aerodaas.console.page import page_routes
from aerodaas.console.surveys import SurveyPlanner
from aerodaas.errors import AeroDaaSError
from aerodaas.protocol.commands import COMMANDS
from aerodaas.protocol.piloting import RearrangeIn, SurveyIn, SurveyOut
from aerodaas.protocol.preflight import PreflightOut
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import (
    AccountOut,
    CommandIn,
    FleetOut,
    MissionOut,
    NavigationIn,
    PictureForm,
    RefusalOut,
    RobotOut,
    Role,
    Scope,
    Word,
)

__all__ = ["account_of", "build_console", "build_page", "require_known"]

_NAMED = 8
"""Most waypoints that an alert names."""


def build_console(flight: OwnFlight, config: EnvironmentConfig, *, framed: bool = False) -> FastAPI:
    """The application that shows `flight`, flown in `config`; a guard stands before it.

    `framed`: a page of this machine, such as a notebook, may hold it in a frame.
    """
    return build_page(_Routes(flight, config).router(), framed=framed, tiles=config.map_tiles)


def build_page(
    routes: APIRouter, *, framed: bool = False, tiles: MapTilesConfig | None = None
) -> FastAPI:
    """The application with the page, and the routes that it asks; a guard stands before it."""
    app = FastAPI(
        title="AeroDaaS console",
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        redirect_slashes=False,
    )
    for kind in (AeroDaaSError, RequestValidationError, AnyHTTPException):
        app.add_exception_handler(kind, _refused)
    app.include_router(page_routes(framed=framed, tiles=tiles))
    app.include_router(archive_routes(tiles))
    app.include_router(routes)
    return app


def account_of(request: Request) -> AccountOut:
    """Who asks."""
    role = role_of(request)
    scopes = [Scope.SENSE] if role is Role.VIEWER else list(Scope)
    return AccountOut(name=role.value, tenant=OWN, role=role, scopes=scopes, created=0.0)


def require_known(mission: str) -> None:
    """Raise HTTPException unless this is the one mission that there is."""
    if mission != OWN:
        raise HTTPException(404, f"there is no mission {mission}: this one is called {OWN}")


class _Routes:
    """The service's routes that the page asks, with the same answers."""

    def __init__(self, flight: OwnFlight, config: EnvironmentConfig) -> None:
        self._flight = flight
        self._hub = StreamHub(flight.items)
        self._surveys = SurveyPlanner()
        self._scenery = SceneryOut.of(config)
        self._fleet = FleetOut(
            name=config.name,
            robots=[
                RobotOut(id=robot.id, sensors=[one.full_id for one in robot.sensors], mission=OWN)
                for robot in config.robots
            ],
            environment=catalogue(config).model_dump(mode="json", by_alias=True),
        )

    def router(self) -> APIRouter:
        """The routes."""
        router = APIRouter(prefix="/v1")
        router.add_api_route("/me", account_of)
        router.add_api_route("/fleet", self.fleet)
        router.add_api_route("/robots/{robot}/preflight", self.preflight)
        router.add_api_route("/missions", self.missions)
        router.add_api_route("/missions/{mission}", self.mission)
        router.add_api_route("/missions/{mission}/scenery", self.scenery)
        router.add_api_route("/missions/{mission}/commands", self.command, methods=["POST"])
        router.add_api_route("/missions/{mission}/navigation", self.navigation, methods=["POST"])
        router.add_api_route("/missions/{mission}/plan", self.rearrange, methods=["POST"])
        router.add_api_route("/missions/{mission}/survey", self.survey, methods=["POST"])
        router.add_api_websocket_route("/missions/{mission}/live", self.live)
        router.add_api_websocket_route("/missions/{mission}/controls", self.controls)
        return router

    def fleet(self) -> FleetOut:
        """The drones, and what may be known of where they fly."""
        return self._fleet

    def preflight(self, robot: str) -> PreflightOut:
        """A robot's list before take-off."""
        found = self._flight.preflight(robot)
        if found is None:
            raise HTTPException(404, f"there is no robot {robot}")
        return found

    def missions(self) -> list[MissionOut]:
        """The one flight."""
        return [self._flight.mission()]

    def mission(self, mission: str) -> MissionOut:
        """The one flight."""
        require_known(mission)
        return self._flight.mission()

    def scenery(self, mission: str) -> SceneryOut:
        """What lies below the flight on the map."""
        require_known(mission)
        return self._scenery

    def command(self, mission: str, body: CommandIn, request: Request) -> AnswerOut:
        """Give a robot a command; answers what the drone said."""
        require_known(mission)
        _require_pilot(request)
        command = COMMANDS[body.command]
        return AnswerOut.of(self._flight.command(body.robot, command, body.command))

    def navigation(self, mission: str, body: NavigationIn, request: Request) -> AnswerOut:
        """Add waypoints to a robot's queue; answers what the drone said."""
        require_known(mission)
        _require_pilot(request)
        what = f"visit {_listed([waypoint.id for waypoint in body.waypoints])}"
        return AnswerOut.of(self._flight.command(body.robot, body.command(), what))

    def rearrange(self, mission: str, body: RearrangeIn, request: Request) -> AnswerOut:
        """Change the order of a robot's coming waypoints, or remove some."""
        require_known(mission)
        _require_pilot(request)
        what = [f"fly {_listed(body.order)} in this order"] if body.order else []
        what += [f"leave out {_listed(body.remove)}"] if body.remove else []
        said = self._flight.command(body.robot, body.command(), " and ".join(what) or "do nothing")
        return AnswerOut.of(said)

    def survey(self, mission: str, body: SurveyIn, request: Request) -> SurveyOut:
        """Plan the survey of an area; nothing is flown."""
        require_known(mission)
        _require_pilot(request)
        status = self._flight.mission().status.get(body.robot)
        return self._surveys.plan(body, self._flight.config, status)

    async def controls(self, socket: WebSocket, mission: str, robot: Word) -> None:
        """Have a robot flown by hand, until the sender lets go or falls silent."""
        require_known(mission)
        _require_pilot(socket)

        def give(command: ControlCommand) -> AnswerOut:
            what = told_of_controls(command)
            return AnswerOut.of(self._flight.command(robot, command, what))

        await ControlSession(socket, role_of(socket).value, give).run()

    async def live(
        self,
        socket: WebSocket,
        mission: str,
        rate: Rate = 5.0,
        streams: StreamNames = "",
        pictures: Form = PictureForm.WHOLE,
        depth: StreamNames = "",
    ) -> None:
        """Send the flight's state, at most `rate` times a second, and items of `streams`.

        Pictures come in a form, with the depth of those that `depth` names beside them.
        """
        require_known(mission)
        session = LiveSession(socket, self._flight, self._hub, mission)
        await session.run(rate, wanted_streams(streams, pictures, depth), own=False)


def _listed(ids: Sequence[str]) -> str:
    """Some ids by name, and how many they are where that would be too long to read."""
    named = ", ".join(ids[:_NAMED])
    return named if len(ids) <= _NAMED else f"{named}, … ({len(ids)})"


def _require_pilot(connection: HTTPConnection) -> None:
    role = role_of(connection)
    if not role.reaches(Role.PILOT):
        raise HTTPException(403, f"this needs the role pilot; you are {role.value}")


def _refused(_: Request, error: Exception) -> JSONResponse:
    """Word a refusal as the service does."""
    status, text = 409, str(error)
    if isinstance(error, RequestValidationError):
        status, text = malformed(error.errors())
    elif isinstance(error, AnyHTTPException):
        status, text = error.status_code, str(error.detail)
    return JSONResponse(RefusalOut(text=text).model_dump(), status)
