"""Turns on an edge that this flight shares with others of its provider."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable

from aerodaas.config.options import EdgeShare

__all__ = ["EdgeTurns"]

_AGAIN_SECONDS = 5.0
"""Between two attempts to reach a service that gives no turns; meanwhile the edge is free."""
_MOST_WAIT = 2.0
"""Seconds after which a turn is taken without being granted: what waits is stale by then, and no
weight is so small that a flight stands still."""
_REST_SECONDS = 0.02
"""After a turn that was not used, before the next one is asked for."""


class EdgeTurns:
    """Asks the provider's service for turns; where it does not answer, each turn is granted.

    A flight must not depend on the service, which may end before it. For one thread; answers are
    heard in another.
    """

    def __init__(self, share: EdgeShare, wake: Callable[[], None]) -> None:
        """Take turns as `share` has it; `wake` is called when one is granted."""
        self._share = share
        self._wake = wake
        self._lock = threading.Lock()
        self._socket: socket.socket | None = None
        self._tried_at = -_AGAIN_SECONDS
        self._asked = False
        self._asked_at = 0.0
        self._rest_until = 0.0
        self._granted = False
        self.used = False
        """Whether a task was started in this turn."""

    @property
    def granted(self) -> bool:
        """Whether it is this flight's turn."""
        waited = self._asked and time.monotonic() - self._asked_at > _MOST_WAIT
        return self._granted or waited

    def ask(self) -> None:
        """Ask for a turn, once; `granted` tells when it is there."""
        now = time.monotonic()
        if self._granted or self._asked or now < self._rest_until:
            return
        if not self._connected():
            self._granted = True
            return
        self._asked, self._asked_at = True, now
        self._say(b"a")

    def release(self, *, again: bool = False) -> None:
        """Give the turn back, and with the same word ask for the next one where there is work.

        Two words would leave a moment in which others are served, whoever's turn it is.
        """
        if not self.used:
            self._rest_until = time.monotonic() + _REST_SECONDS
        self._granted = self.used = self._asked = False
        if self._socket is not None:
            self._asked, self._asked_at = again, time.monotonic()
            self._say(b"ra" if again else b"r")

    def close(self) -> None:
        """Take no more turns."""
        with self._lock:
            self._drop()
            self._tried_at = float("inf")

    def _connected(self) -> bool:
        with self._lock:
            if self._socket is not None:
                return True
            if time.monotonic() - self._tried_at < _AGAIN_SECONDS:
                return False
            self._tried_at = time.monotonic()
            made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            head = {"tenant": self._share.tenant, "weight": self._share.weight}
            try:
                made.settimeout(1.0)
                made.connect(str(self._share.turns))
                made.sendall(f"{json.dumps(head)}\n".encode())
                made.settimeout(None)
            except OSError:
                made.close()
                return False
            self._socket = made
        threading.Thread(target=self._receive, args=(made,), name="turns", daemon=True).start()
        return True

    def _say(self, word: bytes) -> None:
        with self._lock, contextlib.suppress(OSError):
            if self._socket is not None:
                self._socket.sendall(word)

    def _receive(self, connection: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while connection.recv(1):
                self._asked, self._granted = False, True
                self._wake()
        with self._lock:
            if connection is self._socket:
                self._drop()
        # What was asked for is granted: nobody will answer any more.
        if self._asked:
            self._asked, self._granted = False, True
            self._wake()

    def _drop(self) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.shutdown(socket.SHUT_RDWR)
            self._socket.close()
            self._socket = None
