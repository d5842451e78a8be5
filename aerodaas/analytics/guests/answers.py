"""Answers of an analysis' author to its stand-in: checked, and told as the stand-in's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from aerodaas.analytics.base import Context
from aerodaas.analytics.item_json import decoded
from aerodaas.errors import ModelError
from aerodaas.messages.frames import Header
from aerodaas.messages.guest_item import GuestItem
from aerodaas.messages.readings import Alert
from aerodaas.messages.schema import MessageError

__all__ = ["AnswerReader", "AnsweredCondition"]

_ALERTS = 100
"""Most alerts of one analysis in a flight."""
_FIGURES = 32
"""Most figures of one alert."""
_TEXT = 500
_fired: dict[tuple[str, str], frozenset[int]] = {}
"""Triggers whose condition the last result met, by author and analysis."""


@dataclass(frozen=True)
class AnsweredCondition:
    """Condition of a trigger that the author's process has evaluated with its result."""

    author: str
    key: str
    number: int

    def __call__(self, result: object) -> bool:
        """Whether the newest result met it."""
        del result
        return self.number in _fired.get((self.author, self.key), ())


class AnswerReader:
    """Reader of the answers for one analysis."""

    def __init__(
        self, author: str, key: str, produces: type = object, *, kind: str, title: str
    ) -> None:
        """Read answers of `author` for its analysis `key`.

        Args:
            author: Whose process answers.
            key: Id of the analysis there.
            produces: Class of its results.
            kind: Kind of its alerts, which it cannot choose.
            title: Its author in errors.
        """
        self._author = author
        self._key = key
        self._produces = produces
        self._kind = kind
        self._title = title
        self._alerts = 0

    def forget(self) -> None:
        """Forget what the last result met."""
        _fired.pop((self._author, self._key), None)

    def read(self, answer: dict[str, Any], context: Context) -> Any:  # noqa: ANN401 - any item
        """Tell the answer's alerts and return its result.

        Raises ModelError for a failure that it tells of, MessageError for a malformed result or
        of another class than was declared.
        """
        for text, values in _alerts(answer.get("alerts")):
            self._tell(text, values, context)
        failed = answer.get("failed")
        if failed:
            raise ModelError(f"{self._title}: {str(failed)[:_TEXT]}")
        result = decoded(answer.get("item"))
        if not self._is_declared(result):
            raise MessageError(
                f"{self._title}: {self._key} declares {self._produces.__name__} and sent "
                f"{_named(result)}"
            )
        fired = answer.get("fired")
        numbers = fired if isinstance(fired, list) else []
        _fired[self._author, self._key] = frozenset(one for one in numbers if type(one) is int)
        return result

    def _tell(self, text: str, values: dict[str, Any], context: Context) -> None:
        self._alerts += 1
        if self._alerts > _ALERTS + 1:
            return
        if self._alerts > _ALERTS:
            said = f"{self._key} has told {_ALERTS} alerts, the most of one analysis"
            text, values = f"{said}: its next ones are left out", {}
        header = Header(self._alerts, context.now(), self._author)
        context.alert(Alert(header, self._kind, f"{self._author}: {text}", values))

    def _is_declared(self, result: object) -> bool:
        wanted = (int, float) if self._produces is float else self._produces
        return result is None or isinstance(result, wanted)


def _named(result: object) -> str:
    if not isinstance(result, GuestItem):
        return type(result).__name__
    return (
        f"{result.kind} of the application's own, or one that holds an object of a class of its "
        "own: send those of AeroDaaS, or declare object"
    )


def _alerts(found: object) -> list[tuple[str, dict[str, Any]]]:
    """Texts and figures of alerts; what is something else is told as it is."""
    told = found if isinstance(found, list) else []
    pairs = [one if isinstance(one, dict) else {"text": one} for one in told]
    return [(str(one.get("text"))[:_TEXT], _figures(one.get("values"))) for one in pairs]


def _figures(found: object) -> dict[str, Any]:
    pairs = list(found.items())[:_FIGURES] if isinstance(found, dict) else []
    return {
        name[:_TEXT]: value[:_TEXT] if isinstance(value, str) else value
        for name, value in pairs
        if isinstance(name, str) and isinstance(value, bool | int | float | str)
    }
