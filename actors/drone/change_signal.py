"""Signal of changes in one thread, for which calls in other threads wait."""

from __future__ import annotations

import threading

__all__ = ["ChangeSignal"]

_PAUSE_AT_END = 0.1
"""Seconds that a waiting call takes once nothing changes any more."""


class ChangeSignal:
    """Number of changes so far; a call that knows it waits for the next one."""

    def __init__(self) -> None:
        """Start without a change."""
        self._changed = threading.Condition()
        self._number = 0
        self._value: object = None
        self._over = False

    def update(self, value: object) -> None:
        """Count a change if `value` differs from the last one."""
        if value != self._value:
            self._value = value
            self._count()

    def end(self) -> None:
        """Count the last change: later calls of `wait` return almost at once."""
        self._over = True
        self._count()

    def wait(self, known: int, timeout: float) -> int:
        """Return the number of changes once it is another one.

        Args:
            known: Number of changes that the caller has seen.
            timeout: Seconds after which it returns at the latest.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._number != known, _PAUSE_AT_END if self._over else timeout
            )
            return self._number

    def _count(self) -> None:
        with self._changed:
            self._number += 1
            self._changed.notify_all()
