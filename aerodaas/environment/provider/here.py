"""The user's side of a flight, which runs the application's own analyses.

The relay of the provider's flight asks it for one item at a time, over whatever connection stands
between them. The provider's questions are data, as its own graph's answers are.
"""

from __future__ import annotations

import contextlib
import copy
import math
import secrets
import threading
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from aerodaas.analytics.here.relay import oversize
from aerodaas.analytics.wire_items import UnknownClassError, item_json, unpack
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.environment.provider.exchange import pauses
from aerodaas.environment.provider.follower import MissionFollower
from aerodaas.environment.provider.wire import WireConnection
from aerodaas.errors import AeroDaaSError, SourceError, failure_line
from aerodaas.messages.serialization.opaque_item import OpaqueItem
from aerodaas.messages.serialization.schema import MessageError
from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.encoding import plain

if TYPE_CHECKING:
    from aerodaas.analytics.base import Analytics, ComputeKind
    from aerodaas.dataflow.mission_document import MissionDocument
    from aerodaas.environment.environment import Environment
    from aerodaas.messages.readings import Alert

__all__ = ["HereLink", "HereServer"]

_KEPT = 1000
"""Items of the application's own classes that are remembered: seconds of the fastest streams."""


class HereServer:
    """Analyses and conditions of one application, by the ids of its mission document."""

    def __init__(self, environment: Environment, document: MissionDocument) -> None:
        """Serve what `document` leaves at the user's side of the `environment`'s application.

        As in a flight of its own, each analysis is a copy of the application's.
        """
        self._analyses: dict[str, Analytics[Any]] = {}
        self._conditions: dict[str, list[Callable[[Any], bool] | None]] = {}
        """Conditions of each analysis' triggers, in order; None for one that all results meet."""
        for entry in document.analyses:
            work = environment.graph.nodes[entry.id].work
            if entry.here is not None:
                self._analyses[entry.id] = copy.deepcopy(work)
            self._conditions[entry.id] = [
                one.when if trigger.at_users_side else _elsewhere
                for one, trigger in zip(work.given_triggers, entry.triggers, strict=True)
            ]
        self._kept: OrderedDict[bytes, object] = OrderedDict()
        self._keeping = threading.Lock()
        self._locks = {key: threading.Lock() for key in self._conditions}

    def open(self) -> None:
        """Open all analyses, before the connection is made; raises what one raises."""
        for analysis in self._analyses.values():
            analysis.open()

    def close(self) -> None:
        """Close all analyses; raises what one raises."""
        for analysis in self._analyses.values():
            analysis.close()

    def answer(self, request: dict[str, Any], blob: bytes) -> tuple[dict[str, Any], bytes]:
        """Answer one question of the relay; never raises.

        Questions for one analysis are answered in turn; several threads may ask for several.

        Args:
            request: Question as JSON, with its `number`.
            blob: Bytes of the item that come beside the JSON.

        Returns:
            The answer, which goes back as it is, and an empty blob. It has the result as JSON
            (`item`), the numbers of the conditions that it meets (`fired`) and `alerts`; or how
            the analysis or a condition has `failed`.
        """
        began = time.perf_counter()
        try:
            answer = self._answer(request, blob)
            wrong = oversize(answer, b"")
        except Exception as error:  # noqa: BLE001 - whatever a provider sends
            answer, wrong = {}, failure_line(error)
        if wrong:
            answer = {"failed": wrong}
        took = time.perf_counter() - began
        return {**answer, "number": request.get("number"), "took": took}, b""

    def _answer(self, request: dict[str, Any], blob: bytes) -> dict[str, Any]:
        key = str(request.get("key"))
        if key not in self._locks:
            raise MessageError(f"there is no analysis {key[:80]!r} here")
        item = unpack(request.get("item"), blob)
        with self._locks[key]:
            if request.get("do") == "met":
                return self._met(key, item)
            vehicle, now = unpack(request.get("vehicle")), request.get("now")
            if not isinstance(vehicle, VehicleState | None) or not isinstance(now, int):
                raise MessageError("a question without the vehicle's state or its time")
            on: ComputeKind = "cloud" if request.get("on") == "cloud" else "edge"
            return self._process(key, item, _Context(now, vehicle, on))

    def _process(self, key: str, item: object, context: _Context) -> dict[str, Any]:
        """Answer for one item; it is None for an analysis that is a source of its own."""
        try:
            result = self._analyses[key].process(self.revealed(item), context)
            fired = self._fired(key, result)
            answer = {"item": self._json_of(result), "fired": fired}
        except Exception as error:  # noqa: BLE001 - an application's analysis may raise anything
            answer = {"failed": failure_line(error)}
        return {**answer, "alerts": context.alerts}

    def _met(self, key: str, result: object) -> dict[str, Any]:
        """Answer which conditions a result of an analysis elsewhere meets."""
        try:
            return {"fired": self._fired(key, self.revealed(result))}
        except Exception as error:  # noqa: BLE001 - an application's condition may raise anything
            return {"failed": failure_line(error)}

    def _fired(self, key: str, result: object) -> list[int]:
        return [
            number
            for number, when in enumerate(self._conditions[key])
            if result is not None and (when is None or when(result))
        ]

    def _json_of(self, result: object) -> Any:  # noqa: ANN401 - JSON
        try:
            return item_json(result)
        except UnknownClassError:
            return item_json(self._hidden(result))

    def _hidden(self, item: object) -> OpaqueItem:
        """Keep an item of the application's own class; what leaves is a number for it."""
        name = secrets.token_bytes(8)
        with self._keeping:
            self._kept[name] = item
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
        return OpaqueItem(type(item).__name__, plain(item), name)

    def revealed(self, item: object) -> object:
        """The application's own object that an OpaqueItem stands for; anything else as it is.

        Raises MessageError for one that is no longer kept.
        """
        if not isinstance(item, OpaqueItem):
            return item
        with self._keeping:
            if item.data not in self._kept:
                raise MessageError(f"a {item.kind} that is no longer kept here")
            return self._kept[item.data]


@dataclass
class _Context:
    """Services for an application's analysis, for one item."""

    _now: int
    _vehicle: VehicleState | None
    kind: ComputeKind
    alerts: list[dict[str, Any]] = field(default_factory=list)
    """Alerts as JSON, which go with the result."""

    def now(self) -> int:
        """Mission time of the item, nanoseconds."""
        return self._now

    def vehicle(self) -> VehicleState | None:
        """State of the vehicle at the item, where it may be known."""
        return self._vehicle

    def alert(self, alert: Alert) -> None:
        """Send an alert's text and figures with the result."""
        text = f"{alert.kind}: {alert.text}"
        self.alerts.append({"text": text, "values": _figures(alert.values)})


def _figures(values: Mapping[str, Any]) -> dict[str, Any]:
    """Figures as JSON has them: numbers and texts, and the words of anything else."""
    figures = {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in values.items()
    }
    return {
        str(name): value if type(value) in {bool, int, str} or _is_finite(value) else str(value)
        for name, value in figures.items()
    }


def _is_finite(value: object) -> bool:
    return type(value) is float and math.isfinite(value)


def _elsewhere(result: object) -> bool:
    """A condition that the provider evaluates itself: it is never met here."""
    del result
    return False


_WORKERS = 8
"""Questions that are answered at once; each analysis is asked for one item at a time."""
_REFUSALS = 2
"""Refusals for the same reason after which they are told: one may come as the mission ends."""


class HereLink:
    """Answers a flight's questions until it is over; connects again when the connection is lost."""

    def __init__(
        self,
        client: ProviderClient,
        follower: MissionFollower,
        server: HereServer,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Answer by an open `server`, which is closed with this; `say` is told of refusals."""
        self._say = say
        self._client = client
        self._follower = follower
        self._server = server
        self._closed = threading.Event()
        self._connection: WireConnection | None = None
        self._workers = ThreadPoolExecutor(_WORKERS, "here")
        threading.Thread(target=self._run, name="here", daemon=True).start()

    def revealed(self, item: object) -> object:
        """As `HereServer.revealed`."""
        return self._server.revealed(item)

    def close(self) -> None:
        """Answer no more; raises what an analysis raises when it is closed."""
        self._closed.set()
        connection = self._connection
        if connection is not None:
            connection.close()
        self._workers.shutdown(wait=True, cancel_futures=True)
        self._server.close()

    def _run(self) -> None:
        waiting, refusals = pauses(), Counter[str]()
        while not self._closed.is_set() and not self._follower.mission.phase.over:
            try:
                self._connect()
            except (SourceError, RuntimeError):
                # The follower meets and tells the same; the flight tells that it has no answers.
                pass
            except AeroDaaSError as error:
                refusals[str(error)] += 1
                if refusals[str(error)] == _REFUSALS:
                    self._say(f"the analyses at this side are not asked: {error}")
            self._closed.wait(next(waiting))

    def _connect(self) -> None:
        """Answer by one connection."""
        with self._client.here(self._follower.mission.id) as connection:
            self._connection = connection
            while not self._closed.is_set():
                question, blob = connection.receive(None)
                self._workers.submit(self._answer, connection, question, blob)

    def _answer(self, connection: WireConnection, question: dict[str, Any], blob: bytes) -> None:
        answer, data = self._server.answer(question, blob)
        with contextlib.suppress(AeroDaaSError):
            connection.send(answer, data)
