"""HereAnalysis: stands for an analysis at the user's side in a provider's graph, and asks it.

It is the work of a node. Its `process` sends the item to the flight's relay and waits for the
answer, which is checked. A user's side that is missing or slow yields no results, which is told
once.
"""

from __future__ import annotations

import contextlib
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from aerodaas.analytics.base import Analytics, Context
from aerodaas.analytics.here.relay import Channel, ChannelError
from aerodaas.analytics.wire_items import pack, unpack
from aerodaas.errors import ModelError
from aerodaas.messages.frames import Header
from aerodaas.messages.readings import Alert, Readings
from aerodaas.messages.serialization.opaque_item import OpaqueItem
from aerodaas.messages.serialization.schema import MessageError

__all__ = ["AnsweredCondition", "HereAnalysis", "HereConditions", "HereSite"]

_HERE = "here"
"""Source and kind of the alerts of the user's side."""
_ITEM = 4.0
"""Wall seconds for one item; longer than the relay waits, and shorter than the alert of a hung
analysis."""
_ALERTS = 100
"""Most alerts of one analysis in a flight."""
_FIGURES = 32
"""Most figures of one alert."""
_TEXT = 500
"""Most characters of an alert, a figure's name or text, and a failure."""
_fired: dict[str, frozenset[int]] = {}
"""Triggers whose condition the newest result met, by the analysis' id."""


@dataclass(frozen=True)
class HereSite:
    """Where the stand-ins of one flight find its relay."""

    path: Path
    """The relay's Unix socket, on the machine of the flight's process."""
    lossless: bool = False
    """Send frames as PNG rather than JPEG; a flight in simulated time is repeatable only so."""


@dataclass(frozen=True)
class AnsweredCondition:
    """Condition of a trigger that the user's side has evaluated with its result."""

    key: str
    """Id of the analysis in the document."""
    number: int
    """Number of the trigger among the analysis' own, from 0."""

    def __call__(self, result: object) -> bool:
        """Whether the newest result met it."""
        del result
        return self.number in _fired.get(self.key, ())


class HereAnalysis(Analytics[Any]):
    """One analysis at the user's side."""

    _asks = "process"

    def __init__(self, key: str, site: HereSite, produces: type = object) -> None:
        """Ask for the analysis `key` of the document.

        Args:
            key: Its id there.
            site: The flight's relay.
            produces: Class of its results.
        """
        self.key = key
        self.item = produces
        self.sees_vehicle = False
        """Whether it is told the vehicle's state: that of its inputs' robot."""
        self._site = site
        self._channel: Channel | None = None
        self._told = False
        self._alerts = 0

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
        """Ask the user's side for the result.

        Args:
            item: Item of the analysed stream.
            context: Services of its node.

        Returns:
            The result; None while the user's side does not answer.

        Raises:
            ModelError: For a failure there, and once while there is no answer.
            MessageError: For a malformed result, or one of another class than was declared.
        """
        _fired.pop(self.key, None)
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
        """Publish the answer's alerts and return its result, both checked."""
        for text, figures in _alerts(answer.get("alerts")):
            self._publish_alert(text, figures, context)
        failed = answer.get("failed")
        if failed:
            raise ModelError(f"the user's side: {str(failed)[:_TEXT]}")
        result = unpack(answer.get("item"))
        if not self._is_declared(result):
            raise MessageError(
                f"the user's side: {self.key} declares {self.item.__name__} and sent "
                f"{_class_name(result)}"
            )
        fired = answer.get("fired")
        numbers = fired if isinstance(fired, list) else []
        _fired[self.key] = frozenset(number for number in numbers if type(number) is int)
        return result

    def _publish_alert(self, text: str, figures: dict[str, Any], context: Context) -> None:
        self._alerts += 1
        if self._alerts > _ALERTS + 1:
            return
        if self._alerts > _ALERTS:
            text = (
                f"{self.key} has told {_ALERTS} alerts, the most of one analysis: its next ones "
                "are left out"
            )
            figures = {}
        header = Header(self._alerts, context.now(), _HERE)
        context.alert(Alert(header, _HERE, f"{_HERE}: {text}", figures))

    def _is_declared(self, result: object) -> bool:
        declared = (int, float) if self.item is float else self.item
        return result is None or isinstance(result, declared)

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
        except (ChannelError, OSError) as error:
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
        super()._result(answer, context)
        met = len(answer.get("fired", ()))
        return Readings(context.now(), {"met": met}) if met else None


def _class_name(result: object) -> str:
    if not isinstance(result, OpaqueItem):
        return type(result).__name__
    return (
        f"{result.kind[:_TEXT]} of the application's own, or one that holds an object of a class "
        "of its own: send those of AeroDaaS, or declare object"
    )


def _alerts(content: object) -> list[tuple[str, dict[str, Any]]]:
    """Texts and figures of alerts; what is no alert's JSON is its own text."""
    alerts = content if isinstance(content, list) else []
    parts = [one if isinstance(one, dict) else {"text": one} for one in alerts]
    return [(str(one.get("text"))[:_TEXT], _figures(one.get("values"))) for one in parts]


def _figures(content: object) -> dict[str, Any]:
    pairs = list(content.items())[:_FIGURES] if isinstance(content, dict) else []
    return {
        name[:_TEXT]: value[:_TEXT] if isinstance(value, str) else value
        for name, value in pairs
        if isinstance(name, str) and isinstance(value, bool | int | float | str)
    }
