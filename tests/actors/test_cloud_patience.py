"""How long the dispatcher waits for an executor of the cloud that says nothing."""

from __future__ import annotations

import time
from concurrent.futures import Future
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from aerodaas.actors.dispatch.executor import Executed
from aerodaas.actors.dispatch.executor_pool import ExecutorPool
from aerodaas.actors.dispatch.frame_uplink import FrameUplink
from aerodaas.actors.dispatch.remote_executor import Executor, RemoteExecutor, RemoteResult
from aerodaas.actors.streams import encode_message
from aerodaas.clock import NANOSECONDS
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Header
from aerodaas.runtime.dispatch.frame_codec import Codec
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile, Task


class _Frozen:
    """An executor's handle that takes every call and never answers by itself."""

    def __init__(self) -> None:
        self.asked: list[Future[Any]] = []
        self.execute = self.ping = self.ready = SimpleNamespace(remote=self._take)

    def _take(self, *_: object) -> Any:  # noqa: ANN401
        self.asked.append(Future())
        return SimpleNamespace(future=lambda: self.asked[-1])


@pytest.fixture
def cloud() -> RemoteExecutor:
    """One that may take 10 s by its resources."""
    executor = Executor("site", _Frozen(), [], frozenset({"m"}), 2, Codec("none"))
    return RemoteExecutor(executor, FrameUplink(Codec("none")), 10 * NANOSECONDS, lambda: None)


def _task(number: int, deadline: float) -> Task:
    profile = Profile("m", 10.0, 5 * NANOSECONDS, 100 * MILLISECOND, 500 * MILLISECOND)
    return Task(number, profile, 0, round(deadline * NANOSECONDS))


def _send(cloud: RemoteExecutor, task: Task) -> None:
    message: Message[Any] = Message("camera", task.id, 0, Header(0, 0, "camera"), 0, (), b"x")
    cloud.send(task, message, 0, 5.0)


def _given_up(cloud: RemoteExecutor) -> tuple[float, RemoteResult]:
    for tenths in range(200):
        for answer in cloud.answers(tenths * NANOSECONDS // 10):
            return tenths / 10, answer
    raise AssertionError("never")


@pytest.mark.parametrize(
    ("expected", "seconds"), [(None, 10.0), (0.05, 2.0), (1.0, 4.0), (30.0, 10.0)]
)
def test_a_silent_executor_is_lost_by_what_was_expected_of_it(
    cloud: RemoteExecutor, expected: float | None, seconds: float
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


def test_a_task_that_was_late_anyhow_has_timed_out(cloud: RemoteExecutor) -> None:
    """It is not tried again."""
    cloud.executions.observe("m", 0.1)
    _send(cloud, _task(1, 1.5))
    _, answer = _given_up(cloud)
    assert answer.timed_out
    assert not answer.lost


def test_what_waits_for_the_link_is_part_of_what_is_expected(cloud: RemoteExecutor) -> None:
    """Four frames of 50 kB under way over 25 kB/s: the next one is there after ten seconds."""
    cloud.frame_uplink.link.observe(50_000, 2.0)
    cloud.executions.observe("m", 0.1)
    for number in range(4):
        cloud.frame_uplink.uplink.depart(number, 50_000, time.perf_counter())
    cloud.frame_uplink._size = 50_000
    assert cloud.expected("m") == pytest.approx(10.1)


def test_frames_that_were_given_up_are_still_on_the_link(cloud: RemoteExecutor) -> None:
    """Until they are answered, late, or what was sent after them is: nothing overtakes them."""
    cloud.executions.observe("m", 0.05)
    _send(cloud, _task(1, 20.0))
    while not cloud.executor.handle.asked:
        time.sleep(0.001)
    _given_up(cloud)
    assert cloud.gone
    cloud.probe(30 * NANOSECONDS)
    assert cloud.frame_uplink.uplink.waiting > 0
    cloud.executor.handle.asked[-1].set_result(result=True)
    cloud.probe(31 * NANOSECONDS)
    assert cloud.frame_uplink.uplink.waiting > 0
    cloud.probe(33 * NANOSECONDS)
    assert cloud.frame_uplink.uplink.waiting == 0


@pytest.mark.parametrize(("budget", "sent"), [(1.9, False), (2.1, True)])
def test_a_frame_that_has_to_be_late_is_not_sent(budget: float, *, sent: bool) -> None:
    """50 kB over 25 kB/s take two seconds; the task ends at once where that is too long."""
    handle = _Frozen()
    executor = Executor("site", handle, [], frozenset({"m"}), 2, Codec("none"))
    sites = ExecutorPool((executor,), 10 * NANOSECONDS, lambda: None)
    frame_uplink = sites._frame_uplinks["site"]
    frame_uplink.link.observe(50_000, 2.0)
    frame_uplink._size = 50_000
    message: Message[Any] = Message("camera", 1, 0, Header(0, 0, "camera"), 0, (), b"x")
    sites.send(_task(1, 20.0), message, 0, budget)
    answers = list(sites.answers(0))
    frame_uplink._packer.shutdown(wait=True)
    assert len(handle.asked) == sent
    assert [answer.timed_out for answer in answers] == [True] * (not sent)
    assert all("too late" in answer.error for answer in answers)


def test_a_late_answer_tells_of_the_link(cloud: RemoteExecutor) -> None:
    """At once, though all that was known before said something else."""
    link = cloud.frame_uplink.link
    for _ in range(9):
        link.observe(50_000, 0.02)
    cloud.executions.observe("m", 0.05)
    message: Message[Any] = Message("camera", 1, 0, Header(0, 0, "camera"), 0, (), bytes(50_000))
    cloud.send(_task(1, 20.0), message, 0, 30.0)
    while not cloud.executor.handle.asked:
        time.sleep(0.001)
    assert cloud.expected("m") == pytest.approx(0.15, abs=0.1)
    _given_up(cloud)
    time.sleep(0.3)
    spans = (TraceSpan("camera", 0, 0), TraceSpan("m", 0, 10_000_000))
    answered = encode_message(replace(message, spans=spans, item=b""))
    cloud.executor.handle.asked[0].set_result(Executed(answered, 0.0))
    assert list(cloud.answers(20 * NANOSECONDS)) == [], "its task has ended already"
    assert link.bandwidth < 50_000 / 0.28
    assert cloud.frame_uplink.uplink.waiting == 0
