"""Calls that other threads make and a loop carries out in its own thread, between its turns.

State that only the loop's thread touches needs no lock.
"""

from __future__ import annotations

import queue
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from functools import partial
from typing import Any, TypeVar

from aerodaas.types.errors import MissionError

__all__ = ["LoopCalls", "LoopOverError"]

T = TypeVar("T")


class LoopOverError(MissionError):
    """A call came when its loop no longer turned."""


class LoopCalls:
    """A queue of calls, carried out in the order in which they came."""

    def __init__(self, wake: Callable[[], None], publish: Callable[[], None] | None = None) -> None:
        """Start empty.

        Args:
            wake: Lets the loop, which may be asleep, come to `serve` at once; called in any thread.
            publish: Lets others read what the calls have changed; called in the loop's thread
                before any of them is answered, so that a caller reads the effect of its own call.
        """
        self._wake = wake
        self._publish = publish
        self._calls: queue.SimpleQueue[tuple[Callable[[], Any], Future[Any]]] = queue.SimpleQueue()
        self._over = ""

    def ask(self, call: Callable[[], T], timeout: float) -> T:
        """Have the loop make `call` and return its result; raises the call's errors.

        Raises LoopOverError if the loop is over, and MissionError if it does not come to the call
        within `timeout` wall seconds; then it is not made later, either.
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
        raise MissionError(f"the drone's loop did not answer within {timeout:g} s: {said}")

    def serve(self) -> int:
        """Make the calls that wait, in the loop's thread; returns how many there were."""
        answers: list[Callable[[], None]] = []
        while (taken := self._next()) is not None:
            call, answer = taken
            if not answer.set_running_or_notify_cancel():
                continue
            try:
                answers.append(partial(answer.set_result, call()))
            except Exception as error:  # noqa: BLE001 - the caller's failure, never the loop's
                answers.append(partial(answer.set_exception, error))
        if answers and self._publish is not None:
            self._publish()
        for give in answers:
            give()
        return len(answers)

    def close(self, why: str) -> None:
        """End the loop for the reason `why`: waiting and later callers get LoopOverError."""
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
