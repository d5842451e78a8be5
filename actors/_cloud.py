"""The dispatcher's way to the cloud: executions under way, and their answers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import ray
from ray.exceptions import RayError

from aerodaas.actors.streams import decode_message, encode_message
from aerodaas.schedulers.analytics.base import Task
from aerodaas.status import Message

__all__ = ["Cloud"]


class Cloud:
    """Executions in the cloud; a frame crosses the link once, however many analyses want it."""

    def __init__(self, executor: Any, timeout_ns: int) -> None:  # noqa: ANN401 - a Ray handle
        self._executor = executor
        self._timeout = timeout_ns
        self._under_way: dict[Any, tuple[Task, int]] = {}
        self._frames: dict[tuple[str, int], Any] = {}

    def send(self, task: Task, message: Message[Any], now: int) -> None:
        """Start an execution."""
        key = (message.stream, message.seq)
        if key not in self._frames:
            self._frames = dict(list(self._frames.items())[-_FRAMES_KEPT:])
            self._frames[key] = ray.put(encode_message(message))
        reference = self._executor.execute.remote(task.profile.model, self._frames[key])
        self._under_way[reference] = (task, now)

    def answers(self, now: int) -> Iterator[tuple[Task, Message[Any] | None, bool]]:
        """Yield what has come back: the task, its result if any, and whether it timed out."""
        if not self._under_way:
            return
        ready, _ = ray.wait(
            list(self._under_way), num_returns=len(self._under_way), timeout=0, fetch_local=True
        )
        for reference in ready:
            task, _ = self._under_way.pop(reference)
            try:
                yield task, decode_message(memoryview(ray.get(reference))), False
            except RayError:
                yield task, None, False
        for reference, (task, started) in list(self._under_way.items()):
            if now - started > self._timeout:
                del self._under_way[reference]
                ray.cancel(reference)
                yield task, None, True

    @property
    def busy(self) -> bool:
        """True while executions are under way."""
        return bool(self._under_way)


_FRAMES_KEPT = 8
