"""The cloud's present value: chance of being in time, waiting, silence, probes."""

from __future__ import annotations

from collections.abc import Iterable
from math import log, pi, sqrt

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    Profile,
    Resources,
    Result,
    Task,
    TaskOutcome,
    TaskPlace,
)
from aerodaas.schedulers.analytics.estimates import TimeEstimates, chance

__all__ = ["CloudOutlook"]

OVERHEAD = 5 * MILLISECOND
"""Between the decision to send and the sending."""
PROBE_EVERY = NANOSECONDS
"""Least time between two tasks sent only to see whether the cloud is back."""
_CROWDED = 0.9
"""Share of the slots in use at which the rest is kept for the best."""
_OVERDUE = 3.0
"""Standard deviations beyond the mean after which an answer is overdue, ..."""
_GRACE = 50 * MILLISECOND
"""... and this much more."""
_SILENT = 2
"""Overdue answers in a row after which the cloud counts as silent."""
_UNANSWERED = (TaskOutcome.FAILED, TaskOutcome.TIMEOUT)


class CloudOutlook:
    """Estimates the cloud's execution times, its load, and whether it answers at all."""

    def __init__(self) -> None:
        self.resources = Resources()
        self.beliefs = TimeEstimates(shared=True)
        self.silent_since: int | None = None
        self.slot_price = 0.0
        """Value of a slot's time per nanosecond, charged while few slots are free."""
        self._sent: dict[Task, int] = {}
        self._answered = -1
        """When the newest task that came back had been sent."""
        self._last_sent = 0
        self._listen_at = 0.0
        """When the first answer will be overdue; nothing is to be noticed before."""

    @property
    def crowded(self) -> bool:
        """Whether slots are so scarce that they go to the tasks that are worth most in them."""
        return self.slot_price > 0 and len(self._sent) >= _CROWDED * self.resources.cloud_slots

    def set_slot_price(self, demands: Iterable[tuple[float, float]]) -> None:
        """Price slots by (gain per nanosecond, slots wanted) of each model.

        The price is the dual of the fractional knapsack: what the first model gains that no
        longer finds room for all its tasks; nothing if all do.
        """
        left = _CROWDED * self.resources.cloud_slots
        self.slot_price = 0.0
        for density, slots in sorted(demands, reverse=True):
            left -= slots
            if left < 0:
                self.slot_price = max(density, 0.0)
                return

    def value(self, profile: Profile, room: float, bonus: float = 0.0) -> float:
        """Expected utility of sending a task now; never below zero.

        Args:
            profile: Profile of the task.
            room: Time left for its execution, nanoseconds.
            bonus: Worth of a result in time on top of its benefit.
        """
        slots = self.resources.cloud_slots
        if self.silent_since is not None or not slots:
            return 0.0
        benefit = profile.benefit + bonus
        if benefit <= profile.cloud_cost:
            return 0.0
        belief = self.beliefs.belief(profile)
        busy = len(self._sent)
        room -= OVERHEAD if busy < slots else OVERHEAD + self._wait(belief.mean)
        gain = benefit * chance(belief, room) - profile.cloud_cost
        if self.slot_price > 0 and busy >= _CROWDED * slots:
            gain -= self.slot_price * belief.mean
        return gain if gain > 0 else 0.0

    def patience(self, profile: Profile, worth: float, rate: float) -> float:
        """Room below which waiting no longer pays, nanoseconds.

        Waiting a little longer may win `worth`, and makes the cloud miss with the density of its
        time at the room left. Both meet where benefit * density(z) / sigma = rate * worth, solved
        for z, kept between 1 and 3.

        Args:
            profile: Profile of the task that waits.
            worth: Utility that waiting may win.
            rate: How often it does, per nanosecond.
        """
        belief = self.beliefs.belief(profile)
        ratio = rate * worth * belief.sigma * sqrt(2 * pi) / profile.benefit
        z = min(max(sqrt(-2 * log(ratio)), 1.0), 3.0) if 0 < ratio < 1 else 1.0 + 2 * (ratio <= 0)
        return belief.mean + z * belief.sigma + 2 * OVERHEAD + self._wait(belief.mean)

    def latest_start(self, task: Task) -> int:
        """When it is no longer worth its cost to start `task` in the cloud."""
        belief = self.beliefs.belief(task.profile)
        return int(task.deadline - belief.mean + belief.sigma)

    def sent(self, task: Task, now: int) -> None:
        """Take note of a task that leaves for the cloud.

        Args:
            task: The task that leaves.
            now: Time of the event, nanoseconds.
        """
        self._sent[task] = self._last_sent = now

    def finished(self, result: Result, now: int) -> None:
        """Learn from a task that came back, was lost or never started.

        Args:
            result: The task, where it ran, and how it ended.
            now: Time of the event, nanoseconds.
        """
        sent = self._sent.pop(result.task, now)
        self._listen_at = 0.0
        if result.place is not TaskPlace.CLOUD or result.outcome in _UNANSWERED:
            return
        self._answered = max(self._answered, sent)
        if self.silent_since is not None and sent >= self.silent_since:
            self.silent_since = None
        self.beliefs.observe(result.task.profile, result.finished - result.started, now)

    def listen(self, now: int) -> None:
        """Notice that answers are overdue."""
        if now < self._listen_at or self.silent_since is not None:
            return
        overdue = 0
        for task, sent in self._sent.items():
            belief = self.beliefs.belief(task.profile)
            late = belief.mean + _OVERDUE * belief.sigma + _GRACE + self._wait(belief.mean)
            if now - sent <= late:
                if not overdue:
                    self._listen_at = sent + late
                return
            overdue += sent > self._answered
            if overdue >= _SILENT:
                self.silent_since = now
                return

    def wants_probe(self, now: int) -> bool:
        """Whether nothing has been sent for so long that a cheap task should go and see."""
        return self.resources.cloud_slots > 0 and now - self._last_sent >= PROBE_EVERY

    def _wait(self, mean: float) -> float:
        """Expected wait for a slot."""
        ahead = len(self._sent) - self.resources.cloud_slots + 1
        return ahead * mean / self.resources.cloud_slots if ahead > 0 else 0.0
