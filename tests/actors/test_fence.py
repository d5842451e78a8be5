"""Somebody's scheduler behind the fence: whatever it answers, an error says what was wrong."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from aerodaas.errors import SchedulerError
from aerodaas.runtime.dispatch.guarded_scheduler import GuardedDispatch
from aerodaas.schedulers.analytics.base import (
    MILLISECOND,
    AnalyticsScheduler,
    Decision,
    Profile,
    Resources,
    Result,
    RunOnEdge,
    Task,
)
from aerodaas.schedulers.analytics.published.edge_cloud import EdgeCloudEdf

MODEL = Profile("m", 10, 100 * MILLISECOND, 10 * MILLISECOND, 20 * MILLISECOND)


class _Host:
    def __init__(self) -> None:
        self.begun: list[int] = []

    def run_edge(self, task: Task, now: int) -> None:  # noqa: ARG002 - the host protocol
        self.begun.append(task.id)

    def run_cloud(self, task: Task, now: int) -> None:
        self.run_edge(task, now)

    def wake_at(self, at: int) -> None:
        raise AssertionError(f"nobody waits until {at}")

    def decided(self, decision: Decision, now: int) -> None:
        pass

    def closed(self, result: Result) -> None:
        raise AssertionError(f"{result} is not to end here")


class _Nonsense(AnalyticsScheduler):
    """Answers an arrival with whatever the test says."""

    def __init__(self, answer: Callable[[Task], Any]) -> None:
        self.answer = answer

    def task_arrived(self, task: Task, now: int) -> Any:  # noqa: ANN401, ARG002
        return self.answer(task)


def _raising(task: Task) -> Iterator[Decision]:
    yield RunOnEdge(task, str(1 / (task.id - task.id)))


@pytest.mark.parametrize(
    ("answer", "error", "words"),
    [
        (lambda _: None, SchedulerError, "answered an event with None"),
        (lambda _: 42, TypeError, "int"),
        (lambda _: "edge", SchedulerError, "'e': that is none of the decisions"),
        (lambda _: [None], SchedulerError, "None: that is none of the decisions"),
        (lambda t: [t], SchedulerError, "that is none of the decisions"),
        (_raising, ZeroDivisionError, "division"),
        (lambda _: sys.exit(1), SchedulerError, "tried to end the process"),
    ],
)
def test_nonsense_is_named_and_another_goes_on(
    answer: Callable[[Task], Any], error: type[Exception], words: str
) -> None:
    """The task is still undecided afterwards, and edge-first EDF runs it."""
    host = _Host()
    dispatch = GuardedDispatch(_Nonsense(answer), Resources(), host)
    dispatch.start(0)
    task = Task(0, MODEL, 0, MODEL.deadline)
    with pytest.raises(error, match=words):
        dispatch.arrived(task, 0)
    dispatch.replace(EdgeCloudEdf(), 1)
    dispatch.close()
    assert host.begun == [0]
