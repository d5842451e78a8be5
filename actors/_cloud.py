"""The dispatcher's way to the cloud: executions under way, and their answers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from typing import Any

import ray
from ray.exceptions import RayError

from aerodaas.actors.streams import decode_message, encode_message
from aerodaas.schedulers.analytics.base import Task
from aerodaas.status import Message

__all__ = ["Cloud"]

_FRAMES_KEPT = 8


class Cloud:
    """Executions in the cloud; a frame crosses the link once, however many analyses want it."""

    def __init__(self, executor: Any, timeout_ns: int, wake: Callable[[], None]) -> None:  # noqa: ANN401 - a Ray handle
        """Execute on `executor`; `wake` is called, from another thread, when an answer is there."""
        self._executor = executor
        self._timeout = timeout_ns
        self._wake = wake
        self._started: dict[int, tuple[Task, int, Any]] = {}
        self._answered: deque[tuple[Task, Future[bytes]]] = deque()
        self._frames: dict[tuple[str, int], Any] = {}

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

    def answers(self, now: int) -> Iterator[tuple[Task, Message[Any] | None, bool]]:
        """Yield what has come back: the task, its result if any, and whether it timed out.

        An answer that comes after its time-out is passed over.
        """
        while self._answered:
            task, future = self._answered.popleft()
            if self._started.pop(task.id, None) is None:
                continue
            try:
                yield task, decode_message(memoryview(future.result())), False
            except RayError:
                yield task, None, False
        for task, started, _ in list(self._started.values()):
            if now - started > self._timeout:
                del self._started[task.id]
                yield task, None, True

    def finish(self, timeout: float) -> None:
        """Wait up to `timeout` seconds for what is under way, so that its executor may be ended."""
        references = [reference for _, _, reference in self._started.values()]
        if references:
            ray.wait(references, num_returns=len(references), timeout=timeout)
