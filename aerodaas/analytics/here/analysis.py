"""HereAnalysis: stands for an analysis at the user's side in a provider's graph, and asks it.

It is the work of a node. Its `process` sends the item to the flight's relay and waits for the
answer; a user's side that is missing or slow yields no results, which is told once.
"""

from __future__ import annotations

import contextlib
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from aerodaas.analytics.base import Analytics, Context
from aerodaas.analytics.guests.answers import AnswerReader
from aerodaas.analytics.guests.channel import Channel, GuestError
from aerodaas.analytics.wire_items import pack
from aerodaas.errors import ModelError
from aerodaas.messages.readings import Readings

__all__ = ["HERE", "HereAnalysis", "HereConditions", "HereSite"]

HERE = "here"
"""The user's side as an author of answers, and the kind of its alerts."""
_ITEM = 4.0
"""Wall seconds for one item; longer than the relay waits, and shorter than the alert of a hung
analysis."""


@dataclass(frozen=True)
class HereSite:
    """Where the stand-ins of one flight find its relay."""

    path: Path
    """The relay's Unix socket, on the machine of the flight's process."""
    lossless: bool = False
    """Send frames as PNG rather than JPEG; a flight in simulated time is repeatable only so."""


class HereAnalysis(Analytics[Any]):
    """One analysis at the user's side."""

    _asks = "process"

    def __init__(
        self, key: str, site: HereSite, produces: type = object, *, sees_vehicle: bool = False
    ) -> None:
        """Ask for the analysis `key` of the document.

        Args:
            key: Its id there.
            site: The flight's relay.
            produces: Class of its results.
            sees_vehicle: Whether it is told the vehicle's state: that of its inputs' robot.
        """
        self.key = key
        self.item = produces
        self.sees_vehicle = sees_vehicle
        self._site = site
        self._answers = AnswerReader(HERE, key, produces, kind=HERE, title="the user's side")
        self._channel: Channel | None = None
        self._told = False

    def open(self) -> None:
        """Connect to the relay; raises ModelError if it is not on this machine."""
        try:
            self._channel = self._connected()
        except OSError as error:
            raise ModelError(
                f"{self.key} runs at the user's side, and the flight's socket {self._site.path} "
                f"is not to be reached from here: {error.strerror or error}"
            ) from None

    def process(self, item: Any, context: Context) -> Any:  # noqa: ANN401 - any result
        """Ask the user's side; None, and an error once, while it does not answer."""
        self._answers.forget()
        content, blob = pack(item, lossless=self._site.lossless)
        vehicle, _ = pack(context.vehicle() if self.sees_vehicle else None)
        request = {
            "do": self._asks,
            "key": self.key,
            "now": context.now(),
            "on": context.kind,
            "item": content,
            "vehicle": vehicle,
        }
        answer = self._ask(request, blob)
        absent = answer.get("absent")
        if absent:
            if self._told:
                return None
            self._told = True
            raise ModelError(f"{self.key} has no results: {absent}")
        self._told = False
        return self._result(answer, context)

    def close(self) -> None:
        """Leave the relay."""
        if self._channel is not None:
            self._channel.close()

    def _result(self, answer: dict[str, Any], context: Context) -> Any:  # noqa: ANN401
        return self._answers.read(answer, context)

    def _connected(self) -> Channel:
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            connection.connect(str(self._site.path))
        except OSError:
            connection.close()
            raise
        return Channel(connection)

    def _ask(self, request: dict[str, Any], blob: bytes) -> dict[str, Any]:
        try:
            if self._channel is None:
                self._channel = self._connected()
            self._channel.send(request, blob, _ITEM)
            answer, _ = self._channel.receive(_ITEM)
        except (GuestError, OSError) as error:
            # The next answer on this connection could be that to the last question.
            with contextlib.suppress(OSError):
                if self._channel is not None:
                    self._channel.close()
            self._channel = None
            return {"absent": f"the flight's relay: {error}"}
        return answer


class HereConditions(HereAnalysis):
    """Conditions at the user's side of the triggers of an analysis that runs elsewhere.

    It reads that analysis' stream, and its result says how many of them were met.
    """

    produces: ClassVar[type] = Readings
    _asks = "met"

    def _result(self, answer: dict[str, Any], context: Context) -> Readings | None:
        self._answers.read(answer, context)
        met = len(answer.get("fired", ()))
        return Readings(context.now(), {"met": met}) if met else None
