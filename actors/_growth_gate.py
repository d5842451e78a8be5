"""Where a drone's loop takes changes of the graph, and where a lockstep's time stands still.

What counts a measurement's readers must change between two measurements. In real time a change is
taken at the next turn. In lockstep the conductor first lets everything that is under way be done,
then holds mission time until all actors know of the change.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from typing import TypeAlias

from aerodaas.errors import MissionError

__all__ = ["GrowthGate"]

_Change: TypeAlias = tuple[Callable[[], None], "Future[None]"]

_LONGEST_HOLD = 120.0
"""Wall seconds after which time goes on, should the application have died meanwhile."""
_LOOK_INTERVAL = 0.02


class GrowthGate:
    """Passes changes from any thread to the one that flies."""

    def __init__(self) -> None:
        """Let time go on."""
        self._changes: queue.SimpleQueue[_Change] = queue.SimpleQueue()
        self._wanted = False
        self._still = threading.Event()

    def hold(self, timeout: float) -> bool:
        """Have time stand still; False if it does not within `timeout` wall seconds."""
        self._wanted = True
        return self._still.wait(timeout)

    def release(self) -> None:
        """Let time go on."""
        self._wanted = False

    def change(self, change: Callable[[], None], timeout: float) -> None:
        """Have the loop call `change`; raises what that raises.

        Raises MissionError if it was not called within `timeout` wall seconds.
        """
        done: Future[None] = Future()
        self._changes.put((change, done))
        try:
            done.result(timeout)
        except FutureTimeoutError:
            raise MissionError("the mission has ended: nothing can join it") from None

    def visit(self, settle: Callable[[], None] | None = None) -> None:
        """Make the changes that wait, in the loop's thread.

        If time is to stand still, `settle` is called first, and changes are made until `release`.
        """
        if self._wanted and settle is not None:
            settle()
            self._still.set()
            until = time.monotonic() + _LONGEST_HOLD
            while self._wanted and time.monotonic() < until:
                self._make_changes()
                time.sleep(_LOOK_INTERVAL)
            self._wanted = False
            self._still.clear()
        self._make_changes()

    def _make_changes(self) -> None:
        while not self._changes.empty():
            change, done = self._changes.get()
            try:
                change()
            except Exception as error:  # noqa: BLE001 - whoever asked for the change is told
                done.set_exception(error)
            else:
                done.set_result(None)
