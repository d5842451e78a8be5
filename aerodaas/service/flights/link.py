"""Link of the service to a flight's process: a client of the API that it serves on its socket."""

from __future__ import annotations

import contextlib
import json
import logging
import threading
from collections.abc import Callable, Iterator
from typing import Any, TypeVar
from urllib.parse import urlencode

from pydantic import BaseModel, TypeAdapter, ValidationError
from websockets.exceptions import WebSocketException
from websockets.sync.client import unix_connect

from aerodaas.clock import host_time_ns, seconds
from aerodaas.errors import MissionError, SilentError
from aerodaas.http_client import http_client, http_errors
from aerodaas.messages.health import HealthReport
from aerodaas.mission.commands import Answer
from aerodaas.protocol.live import StateMessage
from aerodaas.protocol.piloting import ActuateIn, ControlsIn, RearrangeIn
from aerodaas.protocol.schemas import (
    CommandIn,
    FlightLeaseIn,
    GrantIn,
    MissionOut,
    NavigationIn,
    PictureForm,
    RefusalOut,
    Role,
)
from aerodaas.service.backend import PilotCommand
from aerodaas.service.errors import RepeatedErrorLog
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.own.access import OWN

__all__ = ["FlightLink", "flight_address"]

M = TypeVar("M")

_log = logging.getLogger(__name__)
_CONNECT_SECONDS = 2.0
_CLOSE_SECONDS = 0.2
"""For the flight to take leave of a view, which it may not do while frames of it wait here."""
_ANSWER_SECONDS = 10.0
_SILENT_SECONDS = 15.0
_AGAIN_SECONDS = 0.2
_ITEM_SECONDS = 0.5
_HEARD_SECONDS = 1.0
"""Least seconds between two words to a flight that its user is there."""
_RATE, _ITEMS_RATE = 10.0, 0.5
"""States a second of the view that is followed, and at most of one that is opened for items."""
_MOST_ASKED = 8
"""Requests of a mission's users at once, each of which has a thread that others' may need."""
_MOST_WAITING = 4
"""Frames of a view that wait here: pictures that nobody takes are left out by the flight."""
_REFUSALS = frozenset({403, 404, 409, 422})
"""Statuses of what the flight has refused, which is an answer."""
_SILENT = 504
_PATHS: dict[type[PilotCommand], str] = {
    CommandIn: "commands",
    NavigationIn: "navigation",
    RearrangeIn: "plan",
    ActuateIn: "actuators",
    ControlsIn: "controls",
}


def flight_address(path: str, role: Role, **query: str | float) -> dict[str, Any]:
    """Arguments of `unix_connect` for a WebSocket of a flight's mission, beside its socket.

    Args:
        path: Path of the WebSocket below the mission.
        role: Role as which the service asks: whoever can open the socket is the service.
        **query: Parameters of the address.
    """
    more = f"?{urlencode(query)}" if query else ""
    return {
        "uri": f"ws://flight/v1/missions/{OWN}/{path}{more}",
        "additional_headers": _as_role(role),
        "open_timeout": _CONNECT_SECONDS,
        "close_timeout": _CLOSE_SECONDS,
        "compression": None,
        "ping_interval": None,
        "max_size": None,
        "max_queue": _MOST_WAITING,
        "proxy": None,
    }


def _as_role(role: Role) -> dict[str, str]:
    return {"Authorization": f"Bearer {role.value}"}


class FlightLink:
    """Commands to one flight, its state, and its streams' items; safe in any thread."""

    def __init__(self, folder: FlightFolder, told: Callable[[], None] = lambda: None) -> None:
        """Follow the flight in `folder`; `told` is called after each state, in another thread."""
        self._folder = folder
        self._told = told
        # Of any number of connections: who waits for an answer keeps nobody else from one.
        self._client = http_client(_ANSWER_SECONDS, socket=folder.socket)
        self._heard = threading.Event()
        """Set when the flight is to be told that its user is there."""
        self._places = threading.BoundedSemaphore(_MOST_ASKED)
        self._closed = threading.Event()
        self.mission: MissionOut | None = None
        """Newest state of the flight, as it tells it itself, by this process' host time."""
        self.number = 0
        """Counts the states."""
        threading.Thread(target=self._follow, name="flight", daemon=True).start()
        threading.Thread(target=self._tell_heard, name="presence", daemon=True).start()

    def close(self) -> None:
        """Follow no more; the flight goes on."""
        self._closed.set()
        self._heard.set()
        self._client.close()

    def fly(self, command: PilotCommand, *, operator: bool) -> Answer:
        """Give a robot a command; returns its answer, or why the flight refuses it.

        Those of users wait for none of an operator's and the service's own; these wait for none of
        users', for what a drone does not answer takes long. A command that was sent is not sent
        again, for it may have been carried out.

        Args:
            command: The command, which names the robot.
            operator: Whether an operator or the service gives it.

        Raises:
            MissionError: If the flight cannot be reached, or has too many commands to answer.
        """
        path = _PATHS[type(command)]
        if operator:
            return self._answered("POST", path, command)
        with self._place():
            return self._answered("POST", path, command, Role.PILOT)

    def change_lease(self, lease: FlightLeaseIn) -> Answer:
        """Tell the flight of its lease; raises MissionError as `fly`, also the others below."""
        return self._answered("PUT", "lease", lease)

    def share(self, mission: str, sensors: list[str]) -> Answer:
        """Have the flight share these cameras with an attached mission, and no others.

        Args:
            mission: Id of the attached mission.
            sensors: Full ids of the cameras.
        """
        return self._answered("PUT", f"shares/{mission}", GrantIn(sensors=sensors))

    def withdraw(self, mission: str) -> Answer:
        """Have the flight share nothing with a mission any more."""
        return self._answered("DELETE", f"shares/{mission}")

    def preflight(self, robot: str) -> HealthReport:
        """The list before take-off of one of its robots."""
        path = f"/v1/robots/{robot}/preflight"
        with self._place():
            return self._asked(HealthReport, "GET", path, None, Role.VIEWER)

    def record_presence(self) -> None:
        """Have the flight told that its user is there; nobody waits for that, as it may hang."""
        self._heard.set()

    @contextlib.contextmanager
    def _place(self) -> Iterator[None]:
        """Count a request of users; raises MissionError for too many at once."""
        if not self._places.acquire(blocking=False):
            raise MissionError(
                f"the flight has {_MOST_ASKED} commands to answer: ask again in a moment"
            )
        try:
            yield
        finally:
            self._places.release()

    def _tell_heard(self) -> None:
        while self._heard.wait() and not self._closed.is_set():
            self._heard.clear()
            with contextlib.suppress(MissionError):
                self._answered("POST", "presence")
            self._closed.wait(_HEARD_SECONDS)

    def _answered(
        self, method: str, path: str, content: BaseModel | None = None, role: Role = Role.OPERATOR
    ) -> Answer:
        try:
            return self._asked(Answer, method, f"/v1/missions/{OWN}/{path}", content, role)
        except _RefusalError as error:
            return Answer(accepted=False, text=str(error))

    def _asked(
        self, kind: type[M], method: str, path: str, content: BaseModel | None, role: Role
    ) -> M:
        if self._closed.is_set():
            raise MissionError("the flight is not followed any more")
        body = None if content is None else content.model_dump_json(exclude_unset=True)
        headers = {**_as_role(role), "Content-Type": "application/json"}
        with http_errors(_silent):
            answer = self._client.request(
                method, f"http://flight{path}", content=body, headers=headers
            )
        try:
            if answer.is_success:
                return TypeAdapter(kind).validate_json(answer.content)
            text = RefusalOut.model_validate_json(answer.content).text
        except ValidationError as error:
            raise _silent(error) from None
        if answer.status_code in _REFUSALS:
            raise _RefusalError(text)
        raise (SilentError if answer.status_code == _SILENT else MissionError)(text)

    def items(
        self, stream: str, form: PictureForm = PictureForm.WHOLE
    ) -> Iterator[tuple[dict[str, Any], bytes]]:
        """Yield a stream's items until the flight is over; an empty message a while without any.

        Args:
            stream: Name of the stream.
            form: Form of its pictures.

        Raises:
            MissionError: If the flight is lost.
        """
        try:
            query = {"rate": _ITEMS_RATE, "streams": stream, "pictures": form.value}
            address = flight_address("live", Role.VIEWER, **query)
            with unix_connect(str(self._folder.socket), **address) as view:
                while not self._closed.is_set():
                    try:
                        message = json.loads(view.recv(_ITEM_SECONDS))
                    except TimeoutError:
                        message = {}
                    if message.get("kind") == "end":
                        return
                    if message.get("kind") == "mission":
                        message = {}
                    blob = view.recv(_SILENT_SECONDS) if message.get("blob") else b""
                    yield message, blob if isinstance(blob, bytes) else b""
        except (OSError, EOFError, WebSocketException) as error:
            raise MissionError(f"the flight's stream has ended: {error}") from None

    def _follow(self) -> None:
        errors = RepeatedErrorLog(_log)
        while not self._closed.is_set():
            try:
                self._follow_once()
            except (OSError, EOFError, WebSocketException):
                pass  # Before the process listens and after its end there is nobody to connect to.
            except Exception as error:  # noqa: BLE001 - a state that is not as agreed, of any kind
                errors.log_error(f"{self._folder.path.name}: its state cannot be read", error)
            self._closed.wait(_AGAIN_SECONDS)

    def _follow_once(self) -> None:
        address = flight_address("live", Role.OPERATOR, rate=_RATE)
        with unix_connect(str(self._folder.socket), **address) as view:
            ahead: float | None = None
            while not self._closed.is_set():
                text = view.recv(_SILENT_SECONDS)
                if text == '{"kind": "end"}':
                    return
                state = StateMessage.model_validate_json(text)
                if ahead is None:
                    # The flight's process may count host time from elsewhere.
                    ahead = seconds(host_time_ns() - state.now)
                told = {name: moment + ahead for name, moment in state.mission.told.items()}
                self.mission = state.mission.model_copy(update={"told": told})
                self.number += 1
                self._told()


class _RefusalError(MissionError):
    """The flight refuses what it was asked for."""


def _silent(error: Exception) -> MissionError:
    return MissionError(f"the flight's process does not answer: {error}")
