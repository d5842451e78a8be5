"""The dispatcher's way to the cloud: executions under way, their answers, and whether it is there.

The cloud is gone when its executor's process or node is, or when an execution has timed out and
nothing sent later was answered. From then on it is probed, a few bytes a second, until it answers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError

from aerodaas.actors.executor import UnpreparedError
from aerodaas.actors.streams import decode_message, encode_message
from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import Task
from aerodaas.status import Message

__all__ = ["Cloud", "CloudAnswer"]

_FRAMES_KEPT = 8
_PROBE_EVERY = NANOSECONDS


@dataclass(frozen=True)
class CloudAnswer:
    """What came of an execution in the cloud."""

    task: Task
    message: Message[Any] | None = None
    """The result."""
    timed_out: bool = False
    lost: bool = False
    """Its executor is gone."""
    error: str = ""
    """What the analysis raised."""


class Cloud:
    """Executions in the cloud; a frame crosses the link once, however many analyses want it."""

    def __init__(
        self,
        executor: Any,  # noqa: ANN401 - a Ray handle
        works: Any,  # noqa: ANN401 - a Ray reference
        timeout_ns: int,
        wake: Callable[[], None],
    ) -> None:
        """Execute on `executor`; one that was restarted is given `works`, the analyses, anew.

        `wake` is called, from another thread, when an answer is there.
        """
        self.gone = False
        self._executor = executor
        self._works = works
        self._timeout = timeout_ns
        self._wake = wake
        self._started: dict[int, tuple[Task, int, Any]] = {}
        self._answered: deque[tuple[Task, Future[bytes]]] = deque()
        self._answered_since = -1
        """When the newest execution that was answered had been sent."""
        self._frames: dict[tuple[str, int], Any] = {}
        self._probe: Future[bool] | None = None
        self._preparing: Future[None] | None = None
        self._probed = 0

    def send(self, task: Task, message: Message[Any], now: int) -> None:
        """Start an execution."""
        key = (message.stream, message.seq)
        if key not in self._frames:
            self._frames = dict(list(self._frames.items())[-_FRAMES_KEPT:])
            self._frames[key] = ray.put(encode_message(message))
        reference = self._executor.execute.remote(task.profile.model, self._frames[key])
        self._started[task.id] = (task, now, reference)

        def answered(future: Future[bytes]) -> None:
            self._answered.append((task, future))
            self._wake()

        reference.future().add_done_callback(answered)

    def answers(self, now: int) -> Iterator[CloudAnswer]:
        """Yield what has come back or timed out; what comes after its time-out is passed over."""
        while self._answered:
            task, future = self._answered.popleft()
            found = self._started.pop(task.id, None)
            if found is not None:
                yield self._answer(task, future, found[1])
        for task, started, _ in list(self._started.values()):
            if now - started > self._timeout:
                del self._started[task.id]
                self.gone |= self._answered_since < started
                yield CloudAnswer(task, timed_out=True)

    def probe(self, now: int) -> None:
        """Look whether a cloud that was gone is back; costs a few bytes."""
        if self._probe is not None and self._probe.done():
            probe, self._probe = self._probe, None
            if probe.exception() is None and probe.result():
                self.gone = False
                self._answered_since = now
            elif probe.exception() is None:
                self._prepare()
        if self.gone and self._probe is None and now - self._probed >= _PROBE_EVERY:
            self._probed = now
            future: Future[bool] = self._executor.ready.remote().future()
            future.add_done_callback(lambda _: self._wake())
            self._probe = future

    def _prepare(self) -> None:
        if self._preparing is None or self._preparing.done():
            self._preparing = self._executor.prepare.remote(self._works).future()

    def finish(self, timeout: float) -> None:
        """Wait up to `timeout` seconds for what is under way, so that its executor may be ended."""
        references = [reference for _, _, reference in self._started.values()]
        if references and not self.gone:
            ray.wait(references, num_returns=len(references), timeout=timeout)

    def _answer(self, task: Task, future: Future[bytes], started: int) -> CloudAnswer:
        try:
            message = decode_message(memoryview(future.result()))
        except RayTaskError as error:
            if isinstance(error.cause, UnpreparedError):
                self.gone = True
                return CloudAnswer(task, lost=True)
            self._answered_since = max(self._answered_since, started)
            return CloudAnswer(task, error=f"{type(error.cause).__name__}: {error.cause}")
        except RayError:
            self.gone = True
            return CloudAnswer(task, lost=True)
        self._answered_since = max(self._answered_since, started)
        return CloudAnswer(task, message)
