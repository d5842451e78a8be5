"""What an analytics scheduler has made of its tasks, from its recorded decisions."""

from __future__ import annotations

from collections import Counter

from aerodaas.clock import seconds
from aerodaas.messages.mission import Decision
from aerodaas.protocol.schemas import AnalyticsOut

__all__ = ["DecisionSums"]

_ROW_SECONDS = 0.5
_MOST_ROWS = 12_000
"""Sums that are kept; beyond, every second one is left out."""
_OUTCOMES = frozenset({"done", "late", "timeout", "failed", "dropped"})
"""Names of `TaskOutcome`."""


class DecisionSums:
    """Sums over the decisions up to each time, as a dispatcher reports them in flight."""

    def __init__(self) -> None:
        self._rows: list[AnalyticsOut] = []
        self._interval = _ROW_SECONDS
        self._outcomes: Counter[str] = Counter()
        self._places: Counter[str] = Counter()
        self._totals = {"qos_total": 0.0, "qoe_total": 0.0}
        self._last: float | None = None

    @property
    def rows(self) -> list[AnalyticsOut]:
        """The sums so far, the newest last."""
        if self._last is None or (self._rows and self._rows[-1].time >= self._last):
            return self._rows
        return [*self._rows, *self._row(self._last)]

    def take(self, decision: Decision) -> None:
        """Take one decision or outcome."""
        now, action = seconds(decision.stamp), decision.action
        if action == "drop":
            # A task that its scheduler gives up ends by that.
            self._outcomes["dropped"] += 1
        elif action in _OUTCOMES:
            self._outcomes[action] += 1
            # An outcome's reason begins with where the task ran.
            self._places[decision.reason.partition(":")[0]] += 1
        else:
            return
        figures = decision.values
        self._totals |= {name: figures[name] for name in self._totals if name in figures}
        if self._last is None or now >= self._last:
            self._last = now
        if not self._rows or now >= self._rows[-1].time + self._interval:
            self._rows += self._row(now)
        if len(self._rows) > _MOST_ROWS:
            self._interval *= 2
            del self._rows[1::2]

    def _row(self, time: float) -> list[AnalyticsOut]:
        values = {"outcomes": self._outcomes, "places": self._places, **self._totals}
        row = AnalyticsOut.of(time, values)
        return [] if row is None else [row]
