"""A router of MAVLink packets, as one address of several ends."""

from __future__ import annotations

import socket
import threading
from types import TracebackType

from emulated import LOOPBACK
from typing_extensions import Self

__all__ = ["Router"]


class Router:
    """Passes what one end says on to all others, as a router or a radio does."""

    def __init__(self, companion: int) -> None:
        """With a companion that waits at this port."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, 0))
        self._socket.settimeout(0.05)
        self.port: int = self._socket.getsockname()[1]
        self._ends: set[tuple[str, int]] = {(LOOPBACK, companion)}
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                content, sender = self._socket.recvfrom(4096)
            except (TimeoutError, ConnectionError):
                continue
            self._ends.add(sender)
            for end in self._ends - {sender}:
                self._socket.sendto(content, end)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._closing.set()
        self._thread.join()
        self._socket.close()
