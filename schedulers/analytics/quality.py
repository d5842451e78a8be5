"""Value of one more task in time to a model's window of quality of experience."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi, sqrt

from aerodaas.schedulers.analytics.base import QoeGoal

__all__ = ["QualityWatch"]

_MEMORY = 0.05
"""Weight of the newest task in the share of tasks that finish in time."""


@dataclass(slots=True)
class QualityWatch:
    """Counts one model's tasks in its tumbling windows and prices the next success.

    The bonus is won if at least `needed` of the window's remaining tasks succeed; one success
    matters only if exactly `needed - 1` of the others do. That chance, binomial and here in its
    normal approximation, times the bonus is the value at the margin: nothing while the bonus is
    safe or lost, most where it hangs in the balance.
    """

    goal: QoeGoal
    window: int = -1
    arrived: int = 0
    before: int = 0
    """Tasks of the window before, which forecast this one's."""
    done: int = 0
    missed: int = 0
    success: float = 0.9
    _worth: float | None = None
    """Worked out since the last change."""

    def arrival(self, at: int) -> None:
        """Count a task that arrived, and begin a new window when one is due."""
        self._worth = None
        window = at // self.goal.window
        if window != self.window:
            self.before = self.arrived if window == self.window + 1 else 0
            self.window = window
            self.arrived = self.done = self.missed = 0
        self.arrived += 1

    def ended(self, arrival: int, *, in_time: bool) -> None:
        """Count the end of a task.

        Args:
            arrival: Time of its arrival, nanoseconds.
            in_time: Whether it finished by its deadline.
        """
        self._worth = None
        self.success += _MEMORY * (in_time - self.success)
        if arrival // self.goal.window == self.window:
            self.done += in_time
            self.missed += not in_time

    def worth(self) -> float:
        """Value of one more task in time, above its own benefit."""
        if self._worth is None:
            self._worth = self._marginal_bonus() if self.goal.bonus else 0.0
        return self._worth

    def _marginal_bonus(self) -> float:
        total = max(self.arrived, self.before)
        others = total - self.done - self.missed - 1
        needed = self.goal.share * total - self.done
        if needed <= 0 or needed > others + 1:
            return 0.0
        expected = others * self.success
        variance = max(expected * (1 - self.success), 0.25)
        chance = exp(-((needed - 1 - expected) ** 2) / (2 * variance)) / sqrt(2 * pi * variance)
        return self.goal.bonus * min(chance, 1.0)
