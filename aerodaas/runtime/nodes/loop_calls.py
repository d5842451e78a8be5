"""Calls from other threads that a loop executes in its own thread, between its cycles.

The loop's data thus needs no lock: only its own thread accesses it.
"""

from __future__ import annotations

import queue
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from functools import partial
from typing import Any, TypeVar

from aerodaas.errors import MissionError, SilentError

__all__ = ["LoopCalls", "LoopOverError"]

T = TypeVar("T")


class LoopOverError(MissionError):
    """A call came after the end of its loop."""


class LoopCalls:
    """Queue of calls, executed in the order of arrival."""

    def __init__(self, wake: Callable[[], None], publish: Callable[[], None] | None = None) -> None:
        """Start empty.

        Args:
            wake: Wakes the loop, which may be asleep, for `serve`; called in any thread.
            publish: Publishes the changes of the calls; called in the loop's thread before any
                of them is answered, so that a caller reads the effect of its own call.
        """
        self._wake = wake
        self._publish = publish
        self._calls: queue.SimpleQueue[tuple[Callable[[], Any], Future[Any]]] = queue.SimpleQueue()
        self._over = ""

    def ask(self, call: Callable[[], T], timeout: float) -> T:
        """Execute `call` in the loop and return its result.

        Args:
            call: The call.
            timeout: Wall seconds; a call that has not started by then is withdrawn.

        Raises:
            LoopOverError: If the loop is over.
            SilentError: If the loop does not answer in time.
            Exception: What the call raises.
        """
        answer: Future[T] = Future()
        self._calls.put((call, answer))
        if self._over:
            self._refuse()
        else:
            self._wake()
        try:
            return answer.result(timeout)
        except FutureTimeoutError:
            withdrawn = answer.cancel()
            if answer.done() and not withdrawn:
                return answer.result()
        said = "withdrawn" if withdrawn else "it may still be carried out"
        raise SilentError(f"the drone's loop did not answer within {timeout:g} s: {said}")

    def serve(self) -> int:
        """Execute the queued calls, in the loop's thread; returns their number."""
        answers: list[Callable[[], None]] = []
        while (taken := self._next()) is not None:
            call, answer = taken
            if not answer.set_running_or_notify_cancel():
                continue
            try:
                answers.append(partial(answer.set_result, call()))
            except Exception as error:  # noqa: BLE001 - raised to the caller, not in the loop
                answers.append(partial(answer.set_exception, error))
        if answers and self._publish is not None:
            self._publish()
        for give in answers:
            give()
        return len(answers)

    def close(self, why: str) -> None:
        """End the loop for the reason `why`: queued and later calls raise LoopOverError."""
        self._over = why
        self._refuse()

    def _refuse(self) -> None:
        while (taken := self._next()) is not None:
            if taken[1].set_running_or_notify_cancel():
                taken[1].set_exception(LoopOverError(self._over))

    def _next(self) -> tuple[Callable[[], Any], Future[Any]] | None:
        try:
            return self._calls.get_nowait()
        except queue.Empty:
            return None
