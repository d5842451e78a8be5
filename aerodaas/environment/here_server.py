"""HereServer: the user's side of a flight, which runs the application's own analyses.

It is asked for one item at a time by the relay of the provider's flight, over whatever connection
stands between them. The provider's questions are data, as its own graph's answers are.
"""

from __future__ import annotations

import copy
import secrets
import threading
import time
from collections import OrderedDict
from typing import TYPE_CHECKING, Any

from aerodaas.analytics.guests.works import Works
from aerodaas.analytics.here.relay import oversize
from aerodaas.analytics.wire_items import unpack
from aerodaas.errors import failure_line
from aerodaas.messages.guest_item import GuestItem
from aerodaas.messages.schema import MessageError
from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.encoding import plain

if TYPE_CHECKING:
    from aerodaas.analytics.base import Analytics, ComputeKind
    from aerodaas.dataflow.mission_document import MissionDocument
    from aerodaas.environment.environment import Environment

__all__ = ["HereServer"]

_KEPT = 1000
"""Items of the application's own classes that are remembered: seconds of the fastest streams."""


class HereServer:
    """Analyses and conditions of one application, by the ids of its mission document."""

    def __init__(self, environment: Environment, document: MissionDocument) -> None:
        """Serve what `document` leaves at the user's side of the `environment`'s application.

        As in a flight of its own, each analysis is a copy of the application's.
        """
        graph = environment.graph
        works: dict[str, Analytics[Any]] = {}
        conditions = {}
        for entry in document.analyses:
            work = graph.nodes[entry.id].work
            if entry.here is not None:
                works[entry.id] = copy.deepcopy(work)
            conditions[entry.id] = [
                one.when if trigger.at_users_side else _elsewhere
                for one, trigger in zip(work.given_triggers, entry.triggers, strict=True)
            ]
        self._kept: OrderedDict[bytes, object] = OrderedDict()
        self._keeping = threading.Lock()
        self._works = Works(works, conditions, self._hidden, self.revealed)
        self._locks = {key: threading.Lock() for key in conditions}

    def open(self) -> None:
        """Open all analyses, before the connection is made; raises what one raises."""
        self._works.open()

    def close(self) -> None:
        """Close all analyses; raises what one raises."""
        self._works.close()

    def answer(self, request: dict[str, Any], blob: bytes) -> tuple[dict[str, Any], bytes]:
        """Answer one question of the relay; never raises.

        Questions for one analysis are answered in turn; several threads may ask for several.

        Returns:
            The answer, which goes back as it is, and an empty blob.
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
                return self._works.met(key, item)
            vehicle, now = unpack(request.get("vehicle")), request.get("now")
            if not isinstance(vehicle, VehicleState | None) or not isinstance(now, int):
                raise MessageError("a question without the vehicle's state or its time")
            on: ComputeKind = "cloud" if request.get("on") == "cloud" else "edge"
            return self._works.process(key, item, now, vehicle, on)

    def _hidden(self, item: object) -> GuestItem:
        """Keep an item of the application's own class; what leaves is a number for it."""
        name = secrets.token_bytes(8)
        with self._keeping:
            self._kept[name] = item
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
        return GuestItem(type(item).__name__, plain(item), name)

    def revealed(self, item: object) -> object:
        """The application's own object that a GuestItem stands for; anything else as it is.

        Raises MessageError for one that is no longer kept.
        """
        if not isinstance(item, GuestItem):
            return item
        with self._keeping:
            if item.data not in self._kept:
                raise MessageError(f"a {item.kind} that is no longer kept here")
            return self._kept[item.data]


def _elsewhere(result: object) -> bool:
    """A condition that the provider evaluates itself: it is never met here."""
    del result
    return False
