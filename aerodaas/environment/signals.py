"""Termination of a run, which lands first: SIGTERM and SIGHUP are handled as Ctrl-C is."""

from __future__ import annotations

import os
import signal
import sys
import threading
from pathlib import Path
from types import FrameType

__all__ = ["TerminatedError", "end_of_application", "raise_on_termination"]

_received: TerminatedError | None = None


class TerminatedError(SystemExit):
    """Request to end the process, by a service manager or a closed terminal.

    Its `code` is a shell's exit code for a program that this signal ended.
    """

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.reason = f"received {signal.Signals(number).name}"


def raise_on_termination() -> None:
    """Raise TerminatedError in the main thread from now on; elsewhere, change nothing.

    To be called once Ray has started, for its own handlers end the process at once.
    """
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, _raise)


def end_of_application() -> str:
    """Reason of a flight's end for an application that has ended without waiting for it."""
    return _received.reason if _received else "the application ended"


def _raise(number: int, _: FrameType | None) -> None:
    global _received  # noqa: PLW0603 - a signal is sent to the whole process
    if number == signal.SIGHUP:
        # Output has no reader from now on, and writing to a closed terminal fails.
        sys.stdout = sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115 - for good
    _received = TerminatedError(number)
    raise _received
