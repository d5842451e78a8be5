"""Executors in the cloud as the dispatcher sees them: real processes, without a flight."""

from __future__ import annotations

import contextlib
import os
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from typing import Any, ClassVar

import numpy as np
import pytest
import ray
from ray.exceptions import RayActorError

from aerodaas import Analytics, Frame
from aerodaas.actors.dispatch.executor import FRAMES_KEPT, CloudExecutor
from aerodaas.actors.dispatch.executor_pool import ExecutorPool
from aerodaas.actors.dispatch.remote_executor import Executor, RemoteResult
from aerodaas.analytics.base import Context, TimedContext
from aerodaas.clock import NANOSECONDS, host_time_ns
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.runtime.dispatch.frame_codec import Codec
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile, Task

pytestmark = pytest.mark.wall_clock
_JPEG = Codec()


class Mean(Analytics[dict[str, Any]]):
    """Says what it saw, and how long it might have taken."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = dict

    def __init__(self, *, slow: float = 0.0, fails: bool = False) -> None:
        self._slow = slow
        self._fails = fails
        self._inside = 0
        self._most = 0

    def process(self, item: Frame, context: Context) -> dict[str, Any]:
        """Take the mean."""
        self._inside += 1
        self._most = max(self._most, self._inside)
        time.sleep(self._slow)
        self._inside -= 1
        if self._fails:
            raise ZeroDivisionError("a bug of the user's own")
        left = context.time_left() if isinstance(context, TimedContext) else None
        return {"mean": float(item.image.mean()), "left": left, "most": self._most}


@pytest.fixture
def started(runtime: None) -> Iterator[Callable[..., Executor]]:  # noqa: ARG001 - needs Ray
    """Starts executors, and ends them."""
    handles = []

    def start(
        site: str = "cloud", slots: int = 4, codec: Codec = _JPEG, **works: Analytics[Any]
    ) -> Executor:
        remote: Any = ray.remote(CloudExecutor)
        handle = remote.options(num_cpus=0, max_concurrency=slots + 2, max_restarts=-1).remote()
        handles.append(handle)
        given = ray.put(works)
        executor = Executor(site, handle, [given], frozenset(works), slots, codec)
        ray.get(executor.prepare(), timeout=120)
        return executor

    yield start
    for handle in handles:
        ray.kill(handle)


class Desk:
    """Sends frames and waits for answers, as the dispatcher does."""

    def __init__(self, *executors: Executor, timeout: float = 60.0) -> None:
        self._called = threading.Event()
        self.sites = ExecutorPool(executors, int(timeout * NANOSECONDS), self._called.set)
        self._numbers = iter(range(10**6))
        self._stream = f"drone/{uuid.uuid4().hex}"

    def frame(self, shade: int = 100) -> Message[Frame]:
        """A frame's message."""
        number = next(self._numbers)
        image = np.full((180, 320, 3), shade, np.uint8)
        header = Header(number, number, "drone/camera")
        item = Frame(header, image)
        return Message(self._stream, number, number, header, host_time_ns(), (), item)

    def send(self, model: str, message: Message[Frame], budget: float = 30.0) -> Task:
        """Send a task."""
        profile = Profile(model, 1.0, NANOSECONDS, 100 * MILLISECOND, 300 * MILLISECOND)
        task = Task(next(self._numbers), profile, 0, NANOSECONDS)
        self.sites.send(task, message, host_time_ns(), budget)
        return task

    def answers(self, count: int) -> list[RemoteResult]:
        """Wait for so many answers."""
        found: list[RemoteResult] = []
        end = time.monotonic() + 120
        while len(found) < count:
            assert time.monotonic() < end, f"only {found}"
            self._called.wait(0.1)
            self._called.clear()
            found += self.sites.answers(host_time_ns())
        return found

    def look_until(self, holds: Callable[[], bool]) -> None:
        """Look after the sites, as the dispatcher does between messages."""
        end = time.monotonic() + 120
        while not holds():
            assert time.monotonic() < end, self.sites.values()
            self.sites.probe(host_time_ns())
            time.sleep(0.05)


def test_a_frame_is_sent_once_however_many_want_it(started: Callable[..., Executor]) -> None:
    """Each answer says how its frame came; only the first execution of a frame sent anything."""
    desk = Desk(started(one=Mean(), two=Mean()))
    frames = [desk.frame(shade) for shade in (10, 200)]
    for frame in frames:
        for model in ("one", "two"):
            desk.send(model, frame)
    found = desk.answers(4)
    assert not any(one.error or one.lost or one.timed_out for one in found)
    items = [one.message.item for one in found if one.message]
    assert sorted(round(item["mean"]) for item in items if item) == [10, 10, 200, 200]
    assert {one.way for one in found} == {"jpeg to cloud"}
    sent = [one.figures["sent_kb"] for one in found if one.figures]
    assert sum(size > 0 for size in sent) == len(frames)
    values = desk.sites.values()["cloud"]
    assert (values["codec"], values["frames"]) == ("jpeg", len(frames))
    desk.sites.finish(1.0)


def test_what_a_node_costs_becomes_known(started: Callable[..., Executor]) -> None:
    """Its link by pings before any frame, an analysis by its executions."""
    desk = Desk(started(slow=Mean(slow=0.3)))
    assert desk.sites.expected("slow") is None
    desk.look_until(lambda: desk.sites.values()["cloud"]["latency_ms"] > 0)
    desk.look_until(lambda: desk.sites.values()["cloud"]["bandwidth_mbit"] < float("inf"))
    assert desk.sites.values()["cloud"]["frames"] == 0
    desk.send("slow", desk.frame())
    (answer,) = desk.answers(1)
    assert answer.figures is not None
    assert answer.figures["work_ms"] >= 300
    expected = desk.sites.expected("slow")
    assert expected is not None
    assert expected >= 0.3
    desk.sites.finish(1.0)


def test_an_analysis_runs_one_at_a_time_and_knows_its_time(
    started: Callable[..., Executor],
) -> None:
    """Unless it says that threads may share it, whatever the slots."""
    desk = Desk(started(slow=Mean(slow=0.1)))
    for _ in range(4):
        desk.send("slow", desk.frame(), budget=50.0)
    found = [
        answer.message.item for answer in desk.answers(4) if answer.message and answer.message.item
    ]
    assert [one["most"] for one in found] == [1] * 4
    assert all(0 < one["left"] < 50.0 for one in found)
    desk.sites.finish(1.0)


def test_failures_are_told_with_their_reason(started: Callable[..., Executor]) -> None:
    """A bug in the analysis, and an analysis that nobody there runs."""
    desk = Desk(started(broken=Mean(fails=True)))
    desk.send("broken", desk.frame())
    desk.send("unheard_of", desk.frame())
    errors = {answer.task.profile.model: answer.error for answer in desk.answers(2)}
    assert errors["broken"] == "ZeroDivisionError: a bug of the user's own"
    assert errors["unheard_of"] == "nothing in the cloud runs it"
    desk.sites.finish(1.0)


@pytest.mark.slow
def test_of_two_the_quicker_is_used_and_the_other_when_it_is_gone(
    started: Callable[..., Executor],
) -> None:
    """Both are tried; then the one that answers first. Its slots go with it, and come back."""
    quick, slow = started("near", one=Mean()), started("far", one=Mean(slow=1.0))
    desk = Desk(slow, quick)
    assert desk.sites.slots == 8
    for _ in range(4):
        desk.send("one", desk.frame())
        desk.answers(1)
    desk.send("one", desk.frame())
    assert desk.answers(1)[0].way.endswith(" to near")
    ray.kill(quick.handle, no_restart=False)
    desk.send("one", desk.frame())
    # None is lost where its end is known before the send.
    while (answer := desk.answers(1)[0]).lost:
        desk.send("one", desk.frame())
    assert answer.way.endswith(" to far")
    desk.look_until(lambda: desk.sites.slots == 8)
    desk.sites.finish(1.0)


def test_a_frame_that_an_executor_lacks_is_told_and_carried_again(
    started: Callable[..., Executor],
) -> None:
    """It was restarted and nobody saw: the execution is lost with the reason, the next one done."""
    executor = started(one=Mean(), two=Mean())
    desk = Desk(executor)
    frame = desk.frame()
    desk.send("one", frame)
    desk.answers(1)
    _restart(executor)
    desk.send("two", frame)
    (answer,) = desk.answers(1)
    assert answer.lost
    assert answer.error == "the executor in the cloud lacks the frame"
    assert desk.sites.slots == 4, "the executor itself is there"
    desk.send("two", frame)
    (answer,) = desk.answers(1)
    assert answer.message is not None
    assert answer.figures is not None
    assert answer.figures["sent_kb"] > 0
    desk.sites.finish(1.0)


def test_frames_that_an_executor_no_longer_keeps_are_carried_again(
    started: Callable[..., Executor],
) -> None:
    """Both ends forget the same frames, so that no call is in vain."""
    desk = Desk(started(one=Mean(), two=Mean()))
    frames = [desk.frame() for _ in range(FRAMES_KEPT + 1)]
    for frame in frames:
        desk.send("one", frame)
        desk.answers(1)
    for frame, carried in ((frames[0], True), (frames[-1], False)):
        desk.send("two", frame)
        (answer,) = desk.answers(1)
        assert answer.message is not None
        assert answer.figures is not None
        assert (answer.figures["sent_kb"] > 0) == carried
    desk.sites.finish(1.0)


def _restart(executor: Executor) -> None:
    """Kill its process, and prepare the one that takes its place.

    A call that reaches the old one on its last breath says nothing, or that it has died.
    """
    old = _process_of(executor)
    ray.kill(executor.handle, no_restart=False)
    end = time.monotonic() + 120
    while time.monotonic() < end:
        with contextlib.suppress(RayActorError):
            if _process_of(executor) != old:
                ray.get(executor.prepare())
                return
        time.sleep(0.1)


def _process_of(executor: Executor) -> int:
    number: int = ray.get(executor.handle.__ray_call__.remote(lambda _: os.getpid()))
    return number
