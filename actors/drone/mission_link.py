"""Link between an analysis and the mission: numbered requests, replies, status."""

from __future__ import annotations

import itertools
import secrets
import threading
from concurrent.futures import Future
from typing import Any

from aerodaas.actors.base import StreamActor
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.mission.commands import Answer, Command, Reply, Request, StreamItem
from aerodaas.mission.state_machine import TERMINAL
from aerodaas.runtime.stream_names import reply_stream, request_stream, status_stream
from aerodaas.types.clock import host_time_ns
from aerodaas.types.data import Alert, Header
from aerodaas.types.status import Message, MissionStatus
from aerodaas.types.vehicle import VehicleState

__all__ = ["StreamLink"]

_REPLIES_WAITING = 64


class StreamLink:
    """A `MissionLink` over the streams of one analysis, fed with messages by its worker."""

    def __init__(self, actor: StreamActor, node: str, robot: str) -> None:
        """Link the analysis `node` to the mission of `robot`."""
        self.depths = {status_stream(robot): 1, reply_stream(node): _REPLIES_WAITING}
        """Streams that the worker must read, and their queue depths."""
        self._actor = actor
        self._node = node
        # A restarted actor must not accept replies to its predecessor as its own.
        self._numbers = itertools.count(secrets.randbits(48))
        self._waiting: dict[int, Future[Answer]] = {}
        self._lock = threading.Lock()
        self._status: MissionStatus | None = None
        self._vehicle: VehicleState | None = None

    def open(self) -> None:
        """Open the stream of requests."""
        self._requests = self._actor.publisher(request_stream(self._node))

    def note(self, message: Message[Any]) -> None:
        """Handle a message that the worker has received."""
        item = message.item
        if isinstance(item, MissionStatus):
            self._status = item
        elif isinstance(item, VehicleState):
            self._vehicle = item
        elif isinstance(item, Reply):
            with self._lock:
                waiting = self._waiting.pop(item.number, None)
            if waiting is not None and waiting.set_running_or_notify_cancel():
                waiting.set_result(item.answer)

    def status(self) -> MissionStatus | None:
        """The newest status of the mission; None before the first."""
        return self._status

    def vehicle(self) -> VehicleState | None:
        """The newest state of the vehicle; None before the first."""
        return self._vehicle

    def command(self, command: Command) -> Future[Answer]:
        """Send a command as a request; the worker completes the future."""
        future: Future[Answer] = Future()
        status = self._status
        if status is not None and status.state in TERMINAL:
            text = f"the mission is over: {status.state.value}"
            future.set_result(Answer(accepted=False, text=text))
            return future
        with self._lock:
            number = next(self._numbers)
            self._waiting[number] = future
            header = Header(number, self._actor.clock.now(), self._node)
            self._requests.measure(Request(number, command), header, host_time_ns())
        future.add_done_callback(lambda _: self._waiting.pop(number, None))
        return future

    def fly(self, navigation: AeroNavigation, index: int | None = None) -> Future[Answer]:
        """Add navigation as an item of the analysis' own stream."""
        return self.command(StreamItem(self._node, navigation, index=index, replaces=False))

    def alert(self, alert: Alert) -> None:
        """Publish an alert."""
        self._actor.alert(alert.kind, alert.text, **alert.values)
