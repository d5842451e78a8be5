"""The kit finds what breaks a scheduler, and says so."""

from __future__ import annotations

import threading
from collections.abc import Iterable

import pytest

from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import (
    AnalyticsScheduler,
    Decision,
    Drop,
    Resources,
    RunOnEdge,
    SendToCloud,
    Task,
    WakeAt,
)
from aerodaas.schedulers.analytics.published.edge_only import Fifo
from aerodaas.schedulers.analytics.registry import scheduler_names
from aerodaas.testing.scheduler_kit import check_scheduler


class _Forgetful(Fifo):
    """Loses every tenth task."""

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        return () if task.id % 10 == 0 else super().task_arrived(task, now)


class _Repeating(Fifo):
    """Runs a task again."""

    last: Task | None = None

    def executor_idle(self, now: int) -> Iterable[Decision]:
        if self.last is not None:
            return [RunOnEdge(self.last)]
        self.last = self.queue[0]
        return super().executor_idle(now)


class _Nostalgic(Fifo):
    """Wakes in the past."""

    def timer(self, now: int) -> Iterable[Decision]:
        return [WakeAt(now - 1)]

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        return [*super().task_arrived(task, now), WakeAt(now)]


_seen: list[int] = []


class _Remembering(AnalyticsScheduler):
    """Keeps something between runs."""

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:  # noqa: ARG002
        _seen.append(task.id)
        if len(_seen) % 7 == 0 and self.resources.cloud_slots:
            return [SendToCloud(task)]
        return [Drop(task)]


class _Meddling(AnalyticsScheduler):
    """Changes the tasks."""

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:  # noqa: ARG002
        task.deadline += 1
        return [Drop(task)]


class _Locked(Fifo):
    """Cannot be copied to where it runs."""

    def __init__(self) -> None:
        super().__init__()
        self.lock = threading.Lock()


class _Raising(AnalyticsScheduler):
    """Raises when time is short."""

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:  # noqa: ARG002
        nothing: dict[int, Decision] = {}
        return [nothing[task.id]]


class _Cloudy(AnalyticsScheduler):
    """Sends to the cloud without looking whether there is one."""

    resources = Resources()

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:  # noqa: ARG002
        return [SendToCloud(task)]


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (_Forgetful, r"lost \d+ of \d+ tasks"),
        (_Repeating, "decided before"),
        (_Nostalgic, "in the past"),
        (_Remembering, "two runs over the same events differ"),
        (_Meddling, "changed a task"),
        (_Locked, "cannot be copied"),
        (_Raising, "KeyError"),
        (_Cloudy, "there is no cloud"),
    ],
)
def test_each_fault_is_found_and_named(broken: type[AnalyticsScheduler], words: str) -> None:
    """The message holds the scheduler's name and the rule."""
    with pytest.raises(SchedulerError, match=f"{broken.__name__}.*{words}"):
        check_scheduler(broken, seconds=5)


@pytest.mark.parametrize("name", [*scheduler_names(), "dems_published", "gems_published"])
def test_every_registered_scheduler_passes(name: str) -> None:
    """Ours keep the rules that we ask of others."""
    check_scheduler(name, seconds=8)
