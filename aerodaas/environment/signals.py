"""Signals that end a run, which lands first: SIGTERM and SIGHUP are handled as Ctrl-C is."""

from __future__ import annotations

import os
import signal
import sys
import threading
from pathlib import Path
from types import FrameType

__all__ = [
    "INTERRUPTED",
    "TerminatedError",
    "end_of_application",
    "heed_interrupts",
    "raise_on_signals",
]

INTERRUPTED = "interrupted from the keyboard"

_reason = ""


class TerminatedError(SystemExit):
    """Request to end the process, by a service manager or a closed terminal.

    Its `code` is a shell's exit code for a program that this signal ended.
    """

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.reason = f"received {signal.Signals(number).name}"


def heed_interrupts() -> None:
    """Raise KeyboardInterrupt on SIGINT also where a shell started this process in a script.

    A shell has what a script runs by `&` ignore SIGINT, and a drone is to land all the same.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def raise_on_signals() -> None:
    """Raise TerminatedError or KeyboardInterrupt in the main thread from now on.

    Called elsewhere, it changes nothing; an application's own handler of Ctrl-C is kept, and so is
    nohup's order to outlive the terminal. To be called once Ray has started, for its own handlers
    end the process at once.
    """
    global _reason  # noqa: PLW0603 - a signal is sent to the whole process
    _reason = ""
    if threading.current_thread() is threading.main_thread():
        heed_interrupts()
        for number in (signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, _terminate)
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, _interrupt)


def end_of_application() -> str:
    """Reason of a flight's end for an application that has ended without waiting for it."""
    return _reason or "the application ended"


def _terminate(number: int, _: FrameType | None) -> None:
    global _reason  # noqa: PLW0603
    if number == signal.SIGHUP:
        # Output has no reader from now on, and writing to a closed terminal fails.
        sys.stdout = sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115 - for good
    error = TerminatedError(number)
    _reason = error.reason
    raise error


def _interrupt(_: int, __: FrameType | None) -> None:
    global _reason  # noqa: PLW0603
    _reason = INTERRUPTED
    raise KeyboardInterrupt
