"""Guarded calls of a plug-in scheduler: in a thread of its own, timed and with a timeout."""

from __future__ import annotations

import ctypes
import queue
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.dispatch import Dispatch

__all__ = ["GuardedDispatch"]

_SLOW = 0.05
"""Seconds on one event above which an answer is slow, ..."""
_SLOW_IN_A_ROW = 5
"""... and slow answers in a row that are an error: a single one may be the machine's fault."""
_LIMIT = 2.0
"""Timeout in seconds of one event."""
_PATIENT_LIMIT = 10.0
"""The same for `start`, which may load data, and where events do not hurry."""

_Answer = tuple[Any, BaseException | None, float]


class GuardedDispatch(Dispatch):
    """Dispatch that calls its scheduler in a thread; raises SchedulerError if slow or hanging."""

    hurried = True
    """False if mission time waits: then an answer is never slow, and runs are repeatable."""
    _thinker: _Thinker | None = None
    _slow = 0

    def guarded(self, event: Callable[..., Any]) -> Callable[..., Any]:
        """The call of an event, which returns its answer within the timeout."""
        return partial(self._ask, event)

    def _ask(self, event: Callable[..., Any], *args: Any) -> Any:  # noqa: ANN401
        if self._thinker is None:
            self._thinker = _Thinker()
        patient = not self.hurried or event.__name__ == "start"
        name = type(self.scheduler).__name__
        try:
            answer, error, taken = self._thinker.think(
                event, args, _PATIENT_LIMIT if patient else _LIMIT
            )
        except queue.Empty:
            self._thinker.abandon()
            self._thinker = None
            raise SchedulerError(f"{name}.{event.__name__} does not come to an end") from None
        if error is not None:
            raise error
        self._slow = self._slow + 1 if taken > _SLOW and not patient else 0
        if self._slow >= _SLOW_IN_A_ROW:
            self._slow = 0
            raise SchedulerError(
                f"{name} took more than {_SLOW * 1000:.0f} ms to decide, "
                f"{_SLOW_IN_A_ROW} times in a row"
            )
        return answer

    def close(self) -> None:
        """End the scheduler's thread."""
        if self._thinker is not None:
            self._thinker.end()
            self._thinker = None


class _Thinker:
    """Thread that makes one call at a time."""

    def __init__(self) -> None:
        self._questions: queue.SimpleQueue[tuple[Callable[..., Any], tuple[Any, ...]] | None]
        self._questions = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[_Answer] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="scheduler", daemon=True)
        self._thread.start()

    def think(self, event: Callable[..., Any], args: tuple[Any, ...], limit: float) -> _Answer:
        """Return the answer or the error, and the seconds taken; raises queue.Empty."""
        self._questions.put((event, args))
        return self._answers.get(timeout=limit)

    def end(self) -> None:
        self._questions.put(None)

    def abandon(self) -> None:
        """Abandon the thread, and stop it if it is busy in Python code."""
        self.end()
        ident = ctypes.c_ulong(self._thread.ident or 0)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ident, ctypes.py_object(SystemExit))

    def _run(self) -> None:
        while (question := self._questions.get()) is not None:
            event, args = question
            began = time.perf_counter()
            try:
                answer = event(*args)
                # A generator computes while it is read.
                answer = (
                    answer if answer is None or isinstance(answer, (list, tuple)) else list(answer)
                )
            except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
                self._answers.put((None, error, 0.0))
            except SystemExit:
                refused = SchedulerError(f"{event.__name__} tried to end the process")
                self._answers.put((None, refused, 0.0))
            else:
                self._answers.put((answer, None, time.perf_counter() - began))
