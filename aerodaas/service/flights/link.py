"""Link of the service to a flight's process over its control socket."""

from __future__ import annotations

import contextlib
import logging
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError

from aerodaas.analytics.here.channel import Channel, ChannelError
from aerodaas.clock import host_time_ns, seconds
from aerodaas.errors import ConfigError, MissionError
from aerodaas.protocol.preflight import PreflightOut
from aerodaas.protocol.schemas import AnalyticsOut, AnswerOut, PictureForm, StatusOut, StreamKind
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.trouble import TroubleLog

__all__ = ["FlightLink", "FlightNews"]

_log = logging.getLogger(__name__)
_CONNECT_SECONDS = 2.0
_ANSWER_SECONDS = 10.0
_SILENT_SECONDS = 15.0
_AGAIN_SECONDS = 0.2
_HEARD_SECONDS = 1.0
"""Least seconds between two words to a flight that its user is there."""
_MOST_ASKED = 8
"""Requests of a mission's users at once, each of which has a thread that others' may need."""


@dataclass(frozen=True)
class FlightNews:
    """What a flight has told last."""

    number: int = 0
    """Counts the news."""
    status: dict[str, StatusOut] = field(default_factory=dict)
    told: dict[str, float] = field(default_factory=dict)
    """Host time in seconds when that status came, by robot."""
    alerts: list[str] = field(default_factory=list)
    analytics: AnalyticsOut | None = None
    streams: dict[str, StreamKind] = field(default_factory=dict)
    preflight: dict[str, PreflightOut] = field(default_factory=dict)
    """The list before take-off by robot."""


class _Lane:
    """A connection for requests, one at a time."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.channel: Channel | None = None

    def drop(self) -> None:
        """Close the connection; with the lock held."""
        if self.channel is not None:
            self.channel.close()
            self.channel = None


class FlightLink:
    """Commands to one flight, its news, and its streams' items; safe in any thread."""

    def __init__(self, folder: FlightFolder, told: Callable[[], None] = lambda: None) -> None:
        """Follow the flight in `folder`; `told` is called after each news, in another thread."""
        self._folder = folder
        self._told = told
        self._users, self._own, self._presence = _Lane(), _Lane(), _Lane()
        self._heard = threading.Event()
        """Set when the flight is to be told that its user is there."""
        self._places = threading.BoundedSemaphore(_MOST_ASKED)
        self._closed = threading.Event()
        self.news = FlightNews()
        self._ahead = 0.0
        """Seconds by which this process' host time is ahead of the flight's."""
        threading.Thread(target=self._follow, name="flight", daemon=True).start()
        threading.Thread(target=self._tell_heard, name="presence", daemon=True).start()

    def close(self) -> None:
        """Follow no more; the flight goes on."""
        self._closed.set()
        self._heard.set()
        for lane in (self._users, self._own, self._presence):
            with lane.lock:
                lane.drop()

    def ask(self, **request: Any) -> AnswerOut:  # noqa: ANN401 - JSON
        """Send a request and return its answer.

        One of a user (`operator` is False) waits for those of users before it; an operator's and
        the service's own wait for none of them, for what a flight does not answer takes long.

        Raises MissionError if the flight cannot be reached, or has too many to answer; a request
        that was sent is not sent again, for it may have been carried out.
        """
        if request.get("operator", True):
            return self._asked(self._own, request)
        if not self._places.acquire(blocking=False):
            raise MissionError(
                f"the flight has {_MOST_ASKED} commands to answer: ask again in a moment"
            )
        try:
            return self._asked(self._users, request)
        finally:
            self._places.release()

    def hear(self) -> None:
        """Have the flight told that its user is there; nobody waits for that, as it may hang."""
        self._heard.set()

    def _tell_heard(self) -> None:
        while self._heard.wait() and not self._closed.is_set():
            self._heard.clear()
            with contextlib.suppress(MissionError):
                self._asked(self._presence, {"do": "heard"})
            self._closed.wait(_HEARD_SECONDS)

    def _asked(self, lane: _Lane, request: dict[str, Any]) -> AnswerOut:
        with lane.lock:
            try:
                if lane.channel is None:
                    lane.channel = self._connected("command")
                lane.channel.send(request, timeout=_ANSWER_SECONDS)
                answer, _ = lane.channel.receive(_ANSWER_SECONDS)
                return AnswerOut.model_validate(answer)
            except (ChannelError, OSError, ValidationError) as error:
                lane.drop()
                raise MissionError(f"the flight's process does not answer: {error}") from None

    def items(
        self, stream: str, form: PictureForm = PictureForm.WHOLE
    ) -> Iterator[tuple[dict[str, Any], bytes]]:
        """Yield a stream's items until the flight is over; an empty message a while without any.

        Its pictures come in a form. Raises ConfigError if there is no such stream, MissionError
        if the flight is lost.
        """
        try:
            channel = self._connected("items", stream=stream, form=form.value)
        except (ChannelError, OSError) as error:
            raise MissionError(f"the flight's process does not answer: {error}") from None
        with contextlib.closing(channel):
            first, _ = self._received(channel)
            if "refused" in first:
                raise ConfigError(str(first["refused"]))
            while not self._closed.is_set():
                message, blob = self._received(channel)
                yield message, blob

    def _received(self, channel: Channel) -> tuple[dict[str, Any], bytes]:
        try:
            return channel.receive(_SILENT_SECONDS)
        except ChannelError as error:
            raise MissionError(f"the flight's stream has ended: {error}") from None

    def _connected(self, purpose: str, **more: str) -> Channel:
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        connection.settimeout(_CONNECT_SECONDS)
        try:
            connection.connect(str(self._folder.socket))
        except OSError:
            connection.close()
            raise
        channel = Channel(connection)
        channel.send({"for": purpose, **more}, timeout=_CONNECT_SECONDS)
        return channel

    def _follow(self) -> None:
        trouble = TroubleLog(_log)
        while not self._closed.is_set():
            try:
                self._follow_once()
            except (ChannelError, OSError):
                pass  # Before the process listens and after its end there is nobody to connect to.
            except Exception as error:  # noqa: BLE001 - news that are not as agreed, of any kind
                trouble.tell(f"{self._folder.path.name}: its news cannot be read", error)
            self._closed.wait(_AGAIN_SECONDS)

    def _follow_once(self) -> None:
        with contextlib.closing(self._connected("follow")) as channel:
            message, _ = channel.receive(_SILENT_SECONDS)
            # The flight's process may count host time from elsewhere.
            self._ahead = seconds(host_time_ns()) - message.get("now", 0.0)
            self._take(message)
            while not self._closed.is_set():
                self._take(channel.receive(_SILENT_SECONDS)[0])

    def _take(self, message: dict[str, Any]) -> None:
        robots = {name: StatusOut(**one) for name, one in message["robots"].items()}
        streams = {name: StreamKind(kind) for name, kind in message.get("streams", {}).items()}
        lists = message.get("preflight", {})
        sums = message.get("analytics")
        self.news = FlightNews(
            self.news.number + 1,
            robots,
            {name: moment + self._ahead for name, moment in message.get("told", {}).items()},
            message["alerts"],
            None if sums is None else AnalyticsOut(**sums),
            streams,
            {name: PreflightOut.model_validate(one) for name, one in lists.items()},
        )
        self._told()
