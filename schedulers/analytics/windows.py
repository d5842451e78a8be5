"""Quality of experience: tumbling windows in which enough of a model's tasks finish in time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from aerodaas.schedulers.analytics.base import QoeGoal, Task

__all__ = ["QoeWindows"]


class QoeWindows:
    """Counts tasks by model and window; a task belongs to the window in which it arrived."""

    def __init__(self) -> None:
        self._goals: dict[str, QoeGoal] = {}
        self._arrived: Counter[tuple[str, int]] = Counter()
        self._done: Counter[tuple[str, int]] = Counter()

    def arrived(self, *tasks: Task) -> None:
        """Count tasks; one whose model has no goal does not count."""
        profiles = [task.profile for task in tasks]
        self._goals.update({one.model: one.qoe for one in profiles if one.qoe is not None})
        self._arrived.update(_windows(tasks))

    def done(self, *tasks: Task) -> None:
        """Count tasks that finished in time."""
        self._done.update(_windows(tasks))

    @property
    def utility(self) -> float:
        """Bonuses of the windows that have reached their share so far."""
        return sum(self._goals[model].bonus for model, _ in self._won())

    @property
    def won(self) -> dict[str, tuple[int, int]]:
        """By model: the windows won, and all that have begun."""
        begun = Counter(model for model, _ in self._arrived)
        won = Counter(model for model, _ in self._won())
        return {model: (won[model], count) for model, count in begun.items()}

    def _won(self) -> list[tuple[str, int]]:
        return [
            window
            for window, count in self._arrived.items()
            if self._done[window] >= self._goals[window[0]].share * count
        ]


def _windows(tasks: Iterable[Task]) -> list[tuple[str, int]]:
    return [
        (profile.model, task.arrival // profile.qoe.window)
        for task in tasks
        if (profile := task.profile).qoe is not None
    ]
