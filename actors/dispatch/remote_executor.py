"""Dispatcher's client of one cloud executor: its executions, timeouts and liveness.

The executor counts as gone when its process or node is, or when an execution has timed out and
no later one was answered. It is then probed, with a few bytes per second, until it answers.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, wait
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from pydantic import SecretStr
from ray.exceptions import RayError, RayTaskError

from aerodaas.actors.dispatch.executor import (
    FRAMES_KEPT,
    Executed,
    MissingFrameError,
    UnpreparedError,
)
from aerodaas.actors.dispatch.frame_uplink import FrameTransfer, FrameUplink
from aerodaas.actors.process_variables import ProcessVariables
from aerodaas.actors.streams import UnreadableError, decode_message
from aerodaas.clock import NANOSECONDS
from aerodaas.messages.envelope import Message
from aerodaas.runtime.dispatch.costs import ExecutionEstimates
from aerodaas.runtime.dispatch.frame_codec import Codec
from aerodaas.schedulers.analytics.base import Task

__all__ = ["Executor", "RemoteExecutor", "RemoteResult"]

_PROBE_EVERY = NANOSECONDS
_PATIENCE = 4
"""An execution that takes this many times its expected time is lost, ..."""
_LEAST_PATIENCE = NANOSECONDS
"""... but not before this."""
_SETTLING = NANOSECONDS
"""Mission time for overdue answers of an executor that is back, nanoseconds."""


@dataclass(frozen=True)
class Executor:
    """One executor process of a cloud resource or an endpoint."""

    site: str
    """Id of the compute resource."""
    handle: Any
    """Ray actor handle."""
    works: list[Any]
    """Ray reference to its analyses, in a list so that Ray does not resolve it."""
    models: frozenset[str]
    """Streams of these analyses."""
    slots: int
    codec: Codec
    variables: Mapping[str, SecretStr] = field(default_factory=dict)
    """Environment variables of its process, for its analyses."""

    def prepare(self) -> Any:  # noqa: ANN401 - a Ray reference
        """Call its actor's `prepare`, at the start or after a restart."""
        return self.handle.prepare.remote(ProcessVariables(self.variables), *self.works)


@dataclass(frozen=True)
class RemoteResult:
    """Outcome of an execution in the cloud."""

    task: Task
    message: Message[Any] | None = None
    """Message with the result; None without one."""
    timed_out: bool = False
    lost: bool = False
    """Whether its executor is gone or lacks the frame; `error` has the reason."""
    error: str = ""
    """Exception of the analysis, or the reason of the failure."""
    way: str = ""
    """Codec and destination of the frame."""
    figures: dict[str, float] | None = None
    """Durations in milliseconds and sizes in kilobytes."""


@dataclass
class _Sent:
    task: Task
    at: int
    """Mission time of sending."""
    until: int
    """Mission time after which it has timed out."""
    future: Future[Executed] | None = None
    transfer: FrameTransfer | None = None
    carries: bool = True
    """Whether the call carries the frame; else it refers to it."""
    way: tuple[str, int] = ("", 0)
    """Name of its transfer on the uplink, if it carries the frame."""
    began: float = 0.0
    ended: float = 0.0
    problem: str = ""


class RemoteExecutor:
    """Client of one cloud executor."""

    def __init__(
        self,
        executor: Executor,
        frame_uplink: FrameUplink,
        timeout_ns: int,
        wake: Callable[[], None],
        speed: float = 1.0,
    ) -> None:
        """Send frames through `frame_uplink`, which all executors of a node share.

        A restarted executor is prepared again. `timeout_ns` is mission time and limits an
        execution. `wake` is called, in another thread, when an answer has arrived. `speed` are
        mission seconds per wall second.
        """
        self._second = speed * NANOSECONDS
        self.gone = False
        self.executor = executor
        self.frame_uplink = frame_uplink
        self.executions = ExecutionEstimates()
        self._timeout = timeout_ns
        self._wake = wake
        self._started: dict[int, _Sent] = {}
        self._overdue: dict[int, _Sent] = {}
        """Timed out, but their frames may still be on the link."""
        self._answered: deque[_Sent] = deque()
        self._answered_since = -1
        """Mission time at which the newest answered execution was sent."""
        self._probe: Future[bool] | None = None
        self._preparing: Future[None] | None = None
        self._carried: deque[tuple[str, int]] = deque(maxlen=FRAMES_KEPT)
        """Frames that the executor has."""
        self._probed = 0

    @property
    def load(self) -> float:
        """Current executions per slot."""
        return len(self._started) / self.executor.slots

    def expected(self, model: str) -> float | None:
        """Expected seconds of a task; None before the first execution."""
        work = self.executions.seconds(model)
        return None if work is None else self.frame_uplink.expected + work

    def send(self, task: Task, message: Message[Any], now: int, budget: float) -> None:
        """Start an execution.

        Args:
            task: The task.
            message: The frame.
            now: Mission clock, nanoseconds.
            budget: Host seconds for which its result is useful.
        """
        patience = self._patience(task)
        sent = self._started[task.id] = _Sent(task, now, now + patience)
        self.frame_uplink.announce(message)
        until = time.monotonic() + budget
        self.frame_uplink.later(partial(self._carry, sent, message, until))

    def answers(self, now: int) -> Iterator[RemoteResult]:
        """Yield the results of executions that returned or timed out.

        An answer after the timeout only updates the estimates of the link.
        """
        while self._answered:
            sent = self._answered.popleft()
            if self._started.pop(sent.task.id, None) is not None:
                yield self._answer(sent)
            elif self._overdue.pop(sent.task.id, None) is not None:
                self._hear_late(sent)
            self.frame_uplink.uplink.lose(sent.way)
        for sent in list(self._started.values()):
            if now > sent.until:
                del self._started[sent.task.id]
                if self._answered_since < sent.at:
                    self.gone = True
                    self._overdue[sent.task.id] = sent
                else:
                    self.frame_uplink.uplink.lose(sent.way)
                yield RemoteResult(
                    sent.task,
                    timed_out=now >= sent.task.deadline,
                    lost=now < sent.task.deadline,
                    error="its executor in the cloud did not answer",
                    way=self.executor.site,
                )

    def _patience(self, task: Task) -> int:
        """Timeout of an execution, nanoseconds of mission time.

        A multiple of the expected time, to detect a frozen process; without an estimate, the
        resources' timeout.
        """
        expected = self.expected(task.profile.model)
        if expected is None:
            return self._timeout
        usual = max(task.profile.cloud_time, round(expected * self._second))
        return min(self._timeout, max(_LEAST_PATIENCE, _PATIENCE * usual))

    def probe(self, now: int) -> None:
        """Measure the link, or probe with a few bytes whether a gone executor is back."""
        if self._probe is not None and self._probe.done():
            probe, self._probe = self._probe, None
            if probe.exception() is None and probe.result():
                self.gone = False
                self._carried.clear()
                self._answered_since = now
                self.frame_uplink.look_again()
            elif probe.exception() is None:
                self._prepare()
        if not self.gone:
            if now - self._answered_since > _SETTLING:
                self._forget_overdue()
            self.frame_uplink.ping(self.executor.handle)
        elif self._probe is None and now - self._probed >= _PROBE_EVERY:
            self._probed = now
            future: Future[bool] = self.executor.handle.ready.remote().future()
            future.add_done_callback(lambda _: self._wake())
            self._probe = future

    def _hear_late(self, sent: _Sent) -> None:
        """Update the estimates from an answer after its timeout: the old ones were wrong."""
        if sent.future is not None and sent.future.exception() is None:
            self.frame_uplink.link.forget()
            self._answer(sent)

    def _forget_overdue(self) -> None:
        """Remove overdue executions, because later ones have been answered."""
        for sent in self._overdue.values():
            self.frame_uplink.uplink.lose(sent.way)
        self._overdue.clear()

    def finish(self, timeout: float) -> None:
        """Wait up to `timeout` seconds for current executions, before the executor is ended."""
        futures = [sent.future for sent in self._started.values() if sent.future is not None]
        if futures and not self.gone:
            wait(futures, timeout)
        self.frame_uplink.close()

    def _prepare(self) -> None:
        if self._preparing is None or self._preparing.done():
            self._preparing = self.executor.prepare().future()

    def _carry(self, sent: _Sent, message: Message[Any], until: float) -> None:
        """In the packing thread: encode the frame and start the execution.

        Calls arrive in the order in which they are made, so the next one may refer to the frame.
        """
        try:
            transfer = sent.transfer = self.frame_uplink.pack(message)
            sent.carries = transfer.name not in self._carried
            if sent.carries:
                self._carried.append(transfer.name)
                self.frame_uplink.bytes += len(transfer.data)
            sent.began = time.perf_counter()
            if sent.carries:
                sent.way = (self.executor.site, sent.task.id)
                work = self.executions.seconds(sent.task.profile.model)
                if work is None:
                    work = sent.task.profile.cloud_time / self._second
                self.frame_uplink.uplink.depart(sent.way, len(transfer.data), sent.began, work)
            execute, left = self.executor.handle.execute, until - time.monotonic()
            data = transfer.data if sent.carries else b""
            reference = execute.remote(sent.task.profile.model, transfer.name, data, left)
            future = sent.future = reference.future()
            future.add_done_callback(lambda _: self._came_back(sent))
        except Exception as error:  # noqa: BLE001 - any failure must be reported
            sent.problem = f"{type(error).__name__}: {error}"
            self._came_back(sent)

    def _came_back(self, sent: _Sent) -> None:
        sent.ended = time.perf_counter()
        self._answered.append(sent)
        self._wake()

    def _answer(self, sent: _Sent) -> RemoteResult:
        if sent.future is None:
            return RemoteResult(sent.task, error=sent.problem, way=self.executor.site)
        try:
            executed = sent.future.result()
        except RayTaskError as error:
            if isinstance(error.cause, (UnpreparedError, MissingFrameError)):
                self.gone |= isinstance(error.cause, UnpreparedError)
                self._carried.clear()
                return RemoteResult(sent.task, lost=True, error=str(error.cause))
            self._answered_since = max(self._answered_since, sent.at)
            text = f"{type(error.cause).__name__}: {error.cause}"
            return RemoteResult(sent.task, error=text, way=self.executor.site)
        except RayError:
            self.gone = True
            return RemoteResult(sent.task, lost=True, error="its executor in the cloud is gone")
        self._answered_since = max(self._answered_since, sent.at)
        try:
            return self._learned(sent, executed)
        except UnreadableError as error:
            return RemoteResult(sent.task, error=f"cannot be read: {error}", way=self.executor.site)

    def _learned(self, sent: _Sent, executed: Executed) -> RemoteResult:
        """Update the estimates of link, coding and execution, and return the result."""
        message: Message[Any] = decode_message(memoryview(executed.message))
        transfer, span = sent.transfer, message.spans[-1]
        assert transfer is not None  # noqa: S101 - it was sent
        there = (span.published - span.received) / NANOSECONDS
        link = max(0.0, sent.ended - sent.began - there)
        if sent.carries:
            self.frame_uplink.arrived(sent.way, sent.began + link, executed.decoding)
        self.executions.observe(sent.task.profile.model, there - executed.decoding)
        figures = {
            "link_ms": link * 1e3,
            "work_ms": (there - executed.decoding) * 1e3,
            "decode_ms": executed.decoding * 1e3,
            "sent_kb": len(transfer.data) / 1e3 if sent.carries else 0.0,
            "frame_kb": transfer.original / 1e3,
            "expected_way_ms": transfer.expected * 1e3,
        }
        way = f"{self.executor.codec} to {self.executor.site}"
        return RemoteResult(sent.task, message, way=way, figures=figures)
