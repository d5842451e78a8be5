"""Control socket of a flight: commands from the service, status and items to it.

Each connection begins with what it is for: `command`, `follow`, `items`, `share` or `here`.
Messages are JSON with one blob. The socket lies in the flight's folder, which is open to its user
alone.
"""

from __future__ import annotations

import contextlib
import logging
import queue
import socket
import threading
import time
from collections.abc import Mapping
from typing import Any, Protocol

from pydantic import ValidationError

from aerodaas.analytics.here.channel import Channel, ChannelError
from aerodaas.analytics.here.relay import HereRelay
from aerodaas.clock import host_time_ns, seconds
from aerodaas.errors import AeroDaaSError, MissionError
from aerodaas.mission.commands import Answer, Command
from aerodaas.protocol.commands import COMMANDS
from aerodaas.protocol.piloting import ActuateIn, ControlsIn, RearrangeIn
from aerodaas.protocol.preflight import PreflightOut
from aerodaas.protocol.schemas import (
    AnalyticsOut,
    AnswerOut,
    NavigationIn,
    PictureForm,
    StatusOut,
    StreamKind,
)
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.sharing import Sharing
from aerodaas.service.flights.watch import LeaseWatch
from aerodaas.service.unix_server import UnixServer

__all__ = ["ControlServer", "Flown", "Reader"]

_log = logging.getLogger(__name__)
_MOST_CONNECTIONS = 64
_MOST_WATCHING = 48
"""Connections of these that watch or answer, which a mission's users open: the service has the
rest to command and follow, or whoever watches much could keep an operator from recalling a drone.
"""
_SEND_SECONDS = 5.0
_QUESTIONS = 64
"""Questions to the user's side that wait to be sent; a fuller queue refuses them."""
_PICTURE_SECONDS = 0.2
"""Longest wait for a picture that is asked for."""
_RATE = 10.0
"""Status messages a second."""


_BODIES: Mapping[str, type[NavigationIn | RearrangeIn | ActuateIn | ControlsIn]] = {
    "fly": NavigationIn,
    "rearrange": RearrangeIn,
    "actuate": ActuateIn,
    "controls": ControlsIn,
}
"""Commands with a content, by what is to be done."""


class Reader(Protocol):
    """Reader of one stream."""

    def latest_packed(self, timeout: float) -> tuple[dict[str, Any], bytes] | None:
        """The newest item that was not returned; None if there was none within `timeout`."""
        ...

    def next_packed(self, timeout: float) -> tuple[dict[str, Any], bytes] | None:
        """The next item as a message with its blob; None if there was none within `timeout`."""
        ...


class Flown(Protocol):
    """The flight as its control socket sees it; called from several threads."""

    def command(self, robot: str, command: Command) -> Answer:
        """Execute a command; raises AeroDaaSError."""
        ...

    def status(self) -> tuple[dict[str, StatusOut], list[str]]:
        """Newest status by robot, and the newest alerts."""
        ...

    def told(self) -> dict[str, float]:
        """Host time in seconds when that status came, by robot."""
        ...

    def preflight(self) -> dict[str, PreflightOut]:
        """The list before take-off by robot."""
        ...

    def analytics(self) -> AnalyticsOut | None:
        """What the analytics scheduler has done so far; None without one."""
        ...

    def streams(self) -> dict[str, StreamKind]:
        """The streams that can be drawn, by name."""
        ...

    def reader(self, stream: str, form: PictureForm = PictureForm.WHOLE) -> Reader:
        """A reader of a stream, its pictures in a form; raises AeroDaaSError if there is none."""
        ...

    @property
    def over(self) -> bool:
        """Whether the flight is over."""
        ...


class ControlServer:
    """Serves one flight until it is closed."""

    def __init__(
        self, folder: FlightFolder, flown: Flown, lease: LeaseWatch, relay: HereRelay
    ) -> None:
        """Listen in the flight's folder."""
        self._flown = flown
        self._lease = lease
        self._relay = relay
        self._sharing = Sharing()
        self._server = UnixServer(
            folder.socket, self._serve, name="control", most=_MOST_CONNECTIONS
        )
        self._closed = self._server.closed
        self._watching = threading.BoundedSemaphore(_MOST_WATCHING)

    def start(self) -> None:
        """Accept connections, in a thread of its own."""
        self._server.start()

    def close(self) -> None:
        """Accept no more, and end the connections at their next message."""
        self._server.close()

    def _serve(self, connection: socket.socket) -> None:
        channel = Channel(connection)
        own = {"command": self._commands, "follow": self._follow}
        watching = {"items": self._items, "share": self._share, "here": self._here}
        try:
            first, _ = channel.receive(_SEND_SECONDS)
            purpose = first["for"]
            if purpose in own:
                own[purpose](channel)
            elif self._watching.acquire(blocking=False):
                try:
                    watching[purpose](channel, first)
                finally:
                    self._watching.release()
        except (ChannelError, OSError):
            return
        except Exception:  # noqa: BLE001 - a mistake, which is told of
            _log.exception("what was asked for at the flight's control socket failed")

    def _commands(self, channel: Channel) -> None:
        while not self._closed.is_set():
            request = channel.receive()[0]
            channel.send(self._answer(request), timeout=_SEND_SECONDS)

    def _answer(self, request: dict[str, Any]) -> dict[str, Any]:
        try:
            return self._done(request).model_dump()
        except (AeroDaaSError, ValidationError, KeyError, TypeError, ValueError) as error:
            return AnswerOut(accepted=False, text=str(error)).model_dump()

    def _done(self, request: dict[str, Any]) -> AnswerOut:
        own = self._done_for_service(request)
        if own is not None:
            return own
        if self._lease.reason and not request.get("operator"):
            return AnswerOut(accepted=False, text=f"the drones come home: {self._lease.reason}")
        if request["do"] == "share":
            self._sharing.share(str(request["mission"]), map(str, request["streams"]))
            return AnswerOut(accepted=True)
        return AnswerOut.of(self._commanded(request))

    def _done_for_service(self, request: dict[str, Any]) -> AnswerOut | None:
        """Do what the service asks for itself, whatever became of the lease; None for the rest."""
        accepted = True
        match request["do"]:
            case "heard":
                self._lease.hear()
            case "extend":
                accepted = self._lease.extend(float(request["ends"]))
            case "end":
                self._lease.end(str(request["reason"]))
            case "withdraw":
                self._sharing.withdraw(str(request["mission"]))
            case _:
                return None
        return AnswerOut(accepted=accepted, text="" if accepted else self._lease.reason)

    def _commanded(self, request: dict[str, Any]) -> Answer:
        content, word = request.get("content"), request["do"]
        if word in _BODIES:
            body = _BODIES[word].model_validate(content)
            return self._flown.command(body.robot, body.command())
        if word not in COMMANDS:
            return Answer(accepted=False, text=f"there is no command {word!r}")
        return self._flown.command(request["robot"], COMMANDS[word])

    def _follow(self, channel: Channel) -> None:
        while not self._closed.is_set():
            began = time.monotonic()
            status, alerts = self._flown.status()
            robots = {name: one.model_dump() for name, one in status.items()}
            over = self._flown.over
            streams = self._flown.streams()
            sums = self._flown.analytics()
            message = {
                "robots": robots,
                "told": self._flown.told(),
                "now": seconds(host_time_ns()),
                "alerts": alerts,
                "analytics": None if sums is None else sums.model_dump(),
                "streams": streams,
                "preflight": {
                    name: one.model_dump(mode="json")
                    for name, one in self._flown.preflight().items()
                },
                "over": over,
            }
            channel.send(message, timeout=_SEND_SECONDS)
            if over:
                return
            self._closed.wait(max(0.0, began + 1.0 / _RATE - time.monotonic()))

    def _items(self, channel: Channel, first: dict[str, Any]) -> None:
        try:
            form = PictureForm(first.get("form", PictureForm.WHOLE))
            reader = self._flown.reader(str(first["stream"]), form)
        except AeroDaaSError as error:
            channel.send({"refused": str(error)}, timeout=_SEND_SECONDS)
            return
        channel.send({}, timeout=_SEND_SECONDS)
        while not self._closed.is_set() and not self._flown.over:
            found = reader.next_packed(0.5)
            message, blob = found if found is not None else ({}, b"")
            # An empty message tells whether the other side is still there.
            channel.send(message, blob, timeout=_SEND_SECONDS)

    def _share(self, channel: Channel, first: dict[str, Any]) -> None:
        """Answer each request of an attached mission by the newest picture of a camera."""
        mission, stream = str(first["mission"]), str(first["stream"])
        try:
            if not self._sharing.allows(mission, stream):
                raise MissionError(f"{stream} is not shared with {mission}")
            reader = self._flown.reader(stream)
        except AeroDaaSError as error:
            channel.send({"refused": str(error)}, timeout=_SEND_SECONDS)
            return
        channel.send({}, timeout=_SEND_SECONDS)
        while True:
            channel.receive()
            found = reader.latest_packed(_PICTURE_SECONDS)
            # After the wait: what was withdrawn meanwhile is not sent.
            if (
                self._closed.is_set()
                or self._flown.over
                or not self._sharing.allows(mission, stream)
            ):
                return
            message, blob = found if found is not None else ({}, b"")
            if "captured" in message:
                # The other process may count host time from elsewhere.
                message["age"] = max(0, host_time_ns() - message["captured"])
            channel.send(message, blob, timeout=_SEND_SECONDS)

    def _here(self, channel: Channel, _: dict[str, Any]) -> None:
        """Connect the user's side: questions go out by a bounded queue, answers come in."""
        questions: queue.Queue[tuple[dict[str, Any], bytes]] = queue.Queue(_QUESTIONS)
        user = self._relay.attach(lambda question, blob: questions.put_nowait((question, blob)))
        gone = threading.Event()

        def ask() -> None:
            with contextlib.suppress(ChannelError):
                while not gone.is_set():
                    with contextlib.suppress(queue.Empty):
                        question, blob = questions.get(timeout=0.5)
                        channel.send(question, blob, timeout=_SEND_SECONDS)

        sender = threading.Thread(target=ask, name="questions", daemon=True)
        sender.start()
        try:
            while not self._closed.is_set():
                user.answered_text(*channel.receive_bytes())
        finally:
            gone.set()
            user.detach()
