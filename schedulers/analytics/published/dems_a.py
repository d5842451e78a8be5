"""DEMS-A: DEMS that follows the cloud's times as the network changes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    Decision,
    Drop,
    Result,
    Task,
    TaskOutcome,
    TaskPlace,
)
from aerodaas.schedulers.analytics.published.dems import Dems

__all__ = ["DemsA"]

WINDOW = 10
"""Observed cloud times that make an estimate."""
TOLERANCE = 10 * MILLISECOND
"""Difference between the mean and the estimate that is not worth a change."""
COOLING = 10 * NANOSECONDS
"""Time for which a model stays away from a cloud that became too slow for it."""
_ANSWERED = (TaskOutcome.DONE, TaskOutcome.LATE)


@dataclass(slots=True)
class _Estimate:
    cloud_time: int
    observed: deque[int] = field(default_factory=deque)
    total: int = 0
    """Sum of what was observed."""
    cooling_until: int | None = None
    probe: Task | None = None

    def observe(self, taken: int) -> None:
        """Let the mean of a full window replace an estimate that differs from it."""
        self.observed.append(taken)
        self.total += taken
        if len(self.observed) > WINDOW:
            self.total -= self.observed.popleft()
        if len(self.observed) == WINDOW:
            mean = self.total // WINDOW
            if abs(mean - self.cloud_time) > TOLERANCE:
                self.cloud_time = mean

    def refill(self, taken: int) -> None:
        """Take a probe's time for all of the window."""
        self.observed = deque([taken] * WINDOW)
        self.total = taken * WINDOW
        self.cloud_time = taken


class DemsA(Dems):
    """Per model, the mean of the last 10 cloud times replaces the estimate once it differs.

    The first task that the estimate keeps away from the cloud starts a cooling time; after it
    the next one is a probe with the profile's time. A probe in time refills the window with its
    own time; any other starts the cooling again. A task that never came back has no observed time.
    """

    learns = frozenset({"cloud_time"})

    def __init__(self, *, published: bool = False) -> None:
        super().__init__(published=published)
        self.adapts = True
        """Whether the estimates replace the profiles' times."""
        self._models: dict[str, _Estimate] = {}
        self._fixed: dict[Task, int] = {}
        """Estimates at their arrival of the tasks that have not ended."""

    def drop(self, task: Task, now: int, reason: str) -> Drop:
        """Forget the task's estimate."""
        self._fixed.pop(task, None)
        return super().drop(task, now, reason)

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Fix the estimate of the new task, then as DEMS."""
        model = self._model(task)
        if self.adapts:
            self._fixed[task] = model.cloud_time
        return super().task_arrived(task, now)

    def cloud_time(self, task: Task) -> int:
        """The estimate at the task's arrival."""
        fixed = self._fixed.get(task)
        return task.profile.cloud_time if fixed is None else fixed

    def to_cloud(
        self, task: Task, now: int, reason: str = "no room on the edge"
    ) -> Iterable[Decision]:
        """As DEMS, but a task that the estimate alone keeps away may be a probe."""
        static = now + task.profile.cloud_time <= task.deadline
        if static and task.profile.cloud_gain > 0 and now + self.cloud_time(task) > task.deadline:
            model = self._model(task)
            if model.cooling_until is None:
                model.cooling_until = now + COOLING
            elif now >= model.cooling_until and model.probe is None:
                model.probe = task
                self._fixed[task] = task.profile.cloud_time
                reason = "probe of the cloud"
        return super().to_cloud(task, now, reason)

    def task_finished(self, result: Result, now: int) -> Iterable[Decision]:
        """Learn from a result of the cloud."""
        task = result.task
        self._fixed.pop(task, None)
        model = self._model(task)
        taken = result.finished - result.started
        if model.probe is task:
            model.probe = None
            if result.outcome is TaskOutcome.DONE and result.place is TaskPlace.CLOUD:
                model.refill(taken)
                model.cooling_until = None
            elif result.place is not TaskPlace.EDGE:
                model.cooling_until = now + COOLING
        elif result.place is TaskPlace.CLOUD and result.outcome in _ANSWERED:
            model.observe(taken)
        return super().task_finished(result, now)

    def _model(self, task: Task) -> _Estimate:
        model = self._models.get(task.profile.model)
        if model is None:
            model = self._models[task.profile.model] = _Estimate(task.profile.cloud_time)
        return model
