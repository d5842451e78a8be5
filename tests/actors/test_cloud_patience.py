"""How long the dispatcher waits for an executor of the cloud that says nothing."""

from __future__ import annotations

from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

import pytest

from aerodaas.actors._cloud import Cloud, CloudAnswer, Executor
from aerodaas.actors._parcels import Parcels
from aerodaas.clock import NANOSECONDS
from aerodaas.data import Header
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile, Task
from aerodaas.status import Message


class _Frozen:
    """An executor's handle that takes every call and never answers."""

    def __init__(self) -> None:
        self.execute = self.ping = self.ready = SimpleNamespace(remote=self._take)

    def _take(self, *_: object) -> Any:  # noqa: ANN401
        return SimpleNamespace(future=Future)


@pytest.fixture
def cloud() -> Cloud:
    """One that may take 10 s by its resources."""
    executor = Executor("site", _Frozen(), [], frozenset({"m"}), 2, "none")
    return Cloud(executor, Parcels("none"), 10 * NANOSECONDS, lambda: None)


def _task(number: int, deadline: float) -> Task:
    profile = Profile("m", 10.0, 5 * NANOSECONDS, 100 * MILLISECOND, 500 * MILLISECOND)
    return Task(number, profile, 0, round(deadline * NANOSECONDS))


def _send(cloud: Cloud, task: Task) -> None:
    message: Message[Any] = Message("camera", task.id, 0, Header(0, 0, "camera"), 0, (), b"x")
    cloud.send(task, message, 0, 5.0)


def _given_up(cloud: Cloud) -> tuple[float, CloudAnswer]:
    for tenths in range(200):
        for answer in cloud.answers(tenths * NANOSECONDS // 10):
            return tenths / 10, answer
    raise AssertionError("never")


@pytest.mark.parametrize(
    ("expected", "seconds"), [(None, 10.0), (0.05, 2.0), (1.0, 4.0), (30.0, 10.0)]
)
def test_a_silent_executor_is_lost_by_what_was_expected_of_it(
    cloud: Cloud, expected: float | None, seconds: float
) -> None:
    """Four times as long, by what is told or was seen; while nothing was seen, as resources say."""
    if expected is not None:
        cloud.executions.observe("m", expected)
    _send(cloud, _task(1, 20.0))
    at, answer = _given_up(cloud)
    assert at == pytest.approx(seconds, abs=0.11)
    assert cloud.gone
    assert answer.lost, "so that it is tried again"
    assert not answer.timed_out


def test_a_task_that_was_late_anyhow_has_timed_out(cloud: Cloud) -> None:
    """It is not tried again."""
    cloud.executions.observe("m", 0.1)
    _send(cloud, _task(1, 1.5))
    _, answer = _given_up(cloud)
    assert answer.timed_out
    assert not answer.lost


def test_what_waits_for_the_link_is_part_of_what_is_expected(cloud: Cloud) -> None:
    """Four frames of 50 kB under way over 25 kB/s: the next one is there after ten seconds."""
    cloud.parcels.link.observe(50_000, 2.0)
    cloud.executions.observe("m", 0.1)
    for number in range(4):
        cloud.parcels.uplink.depart(number, 50_000, 0.0)
    cloud.parcels._size = 50_000
    assert cloud.expected("m") == pytest.approx(10.1)
