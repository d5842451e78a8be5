"""Watchdog of the cluster's head, for whose return Ray waits without a message."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable

from aerodaas.actors.cluster.handshake import HTTP2_PREFACE, listener_of

__all__ = ["HeadWatch", "answers"]

_EVERY = 0.5
_PATIENCE = 2.0
"""Timeout of an answer in seconds: enough for a packet that is lost once."""
_LOST_AFTER = 4.0
"""Seconds without an answer before the alert, which is told within five."""


class HeadWatch:
    """Watchdog that connects to the head every few seconds, in a thread of its own."""

    def __init__(self, address: str, tell: Callable[[str, str], None]) -> None:
        """Start to watch the head at `address`, `host:port`.

        `tell` is called in the thread with the kind and the text of an alert.
        """
        self.address = address
        self.lost = False
        """True while the head is considered lost."""
        self._tell = tell
        self._ended = threading.Event()
        if (listener := listener_of(address)) is not None:
            watching = threading.Thread(target=self._watch, args=(listener,), daemon=True)
            watching.start()

    def end(self) -> None:
        """Stop watching."""
        self._ended.set()

    def _watch(self, listener: tuple[str, int]) -> None:
        answered = time.monotonic()
        while not self._ended.wait(_EVERY):
            if answers(listener):
                if self.lost:
                    away = time.monotonic() - answered
                    self.lost = False
                    self._tell("head_back", f"the cluster's head is back after {away:.0f} s")
                answered = time.monotonic()
            elif not self.lost and time.monotonic() - answered > _LOST_AFTER:
                self.lost = True
                self._tell(
                    "head_lost",
                    f"the cluster's head at {self.address} is out of reach: the flight goes on "
                    "without it, but nothing that dies now is restarted",
                )


def answers(listener: tuple[str, int]) -> bool:
    """Whether a gRPC server answers at this host and port, with or without TLS.

    A connection alone is no answer: of a process that hangs, the kernel accepts it.
    """
    try:
        with socket.create_connection(listener, timeout=_PATIENCE) as link:
            link.sendall(HTTP2_PREFACE)
            link.recv(1)
    except ConnectionResetError:
        return True  # a server that expects TLS hangs up
    except OSError:
        return False
    return True
