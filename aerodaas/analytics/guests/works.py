"""An author's analyses and conditions, run by its process as its stand-ins ask."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from aerodaas.analytics.item_json import encoded
from aerodaas.errors import failure_line
from aerodaas.messages.guest_item import GuestItem

if TYPE_CHECKING:
    from aerodaas.analytics.base import Analytics, ComputeKind
    from aerodaas.messages.readings import Alert
    from aerodaas.messages.vehicle import VehicleState

__all__ = ["Condition", "Works"]

Condition: TypeAlias = Callable[[Any], bool]


class Works:
    """Analyses by their ids, and the conditions of their triggers."""

    def __init__(
        self,
        works: Mapping[str, Analytics[Any]],
        conditions: Mapping[str, Sequence[Condition | None]],
        opaque: Callable[[object], GuestItem],
        revealed: Callable[[GuestItem], object],
    ) -> None:
        """Run `works`.

        Args:
            works: Analyses by id.
            conditions: Those of each one's triggers, in order; None for one that all results meet.
            opaque: Hides an item of the author's own class from whoever asks.
            revealed: The item that `opaque` has hidden.
        """
        self._works = works
        self._conditions = conditions
        self._opaque = opaque
        self._revealed = revealed

    def open(self) -> None:
        """Open all analyses; raises what one raises."""
        for work in self._works.values():
            work.open()

    def close(self) -> None:
        """Close all analyses; raises what one raises."""
        for work in self._works.values():
            work.close()

    def process(
        self, key: str, item: object, now: int, vehicle: VehicleState | None, kind: ComputeKind
    ) -> dict[str, Any]:
        """Answer for one item.

        Args:
            key: Id of the analysis.
            item: The item; None for a source of its own.
            now: Mission time, nanoseconds.
            vehicle: State of the vehicle, where it may be known.
            kind: Compute resource that the analysis is told to be on.

        Returns:
            The result as JSON (`item`), the numbers of the conditions that it meets (`fired`) and
            `alerts`; or how the analysis or a condition has `failed`.
        """
        context = _Context(now, vehicle, kind)
        try:
            result = self._works[key].process(self._shown(item), context)
            fired = self._fired(key, result)
            answer = {"item": encoded(result, self._opaque), "fired": fired}
        except Exception as error:  # noqa: BLE001 - an author's analysis may raise anything
            answer = {"failed": failure_line(error)}
        return {**answer, "alerts": context.alerts}

    def met(self, key: str, result: object) -> dict[str, Any]:
        """Answer which conditions of `key` a result of an analysis elsewhere meets."""
        try:
            return {"fired": self._fired(key, self._shown(result))}
        except Exception as error:  # noqa: BLE001 - an author's condition may raise anything
            return {"failed": failure_line(error)}

    def _shown(self, item: object) -> object:
        return self._revealed(item) if isinstance(item, GuestItem) else item

    def _fired(self, key: str, result: object) -> list[int]:
        return [
            number
            for number, when in enumerate(self._conditions.get(key, ()))
            if result is not None and (when is None or when(result))
        ]


@dataclass
class _Context:
    """Services for an author's analysis."""

    _now: int
    _vehicle: VehicleState | None
    kind: ComputeKind

    def __post_init__(self) -> None:
        self.alerts: list[dict[str, Any]] = []

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
    found = {
        name: one.item() if isinstance(one, np.generic) else one for name, one in values.items()
    }
    return {
        str(name): one if type(one) in {bool, int, str} or _finite(one) else str(one)
        for name, one in found.items()
    }


def _finite(value: object) -> bool:
    return type(value) is float and math.isfinite(value)
