"""A relay between an autopilot and the driver, which can be cut."""

from __future__ import annotations

import contextlib
import select
import socket
import threading

__all__ = ["Relay"]

_LARGEST = 65535


class Relay:
    """Passes packets both ways from the autopilot's `url` to its own."""

    def __init__(self, url: str) -> None:
        """Open both ends; `url` is `udpin:` or `tcp:`, as the driver would take it."""
        kind, host, port = url.split(":")
        self._autopilot: tuple[str, int] | None = None
        if kind == "tcp":
            self._outer = socket.create_connection((host, int(port)), timeout=30.0)
        else:
            self._outer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._outer.bind((host, int(port)))
        self._stream = kind == "tcp"
        self._inner = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._inner.bind(("127.0.0.1", 0))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self._driver: tuple[str, int] = probe.getsockname()
        self.url = f"udpin:127.0.0.1:{self._driver[1]}"
        """Where the driver meets it."""
        self.cut = False
        """Set to lose everything, both ways."""
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def inject(self, packet: bytes) -> None:
        """Say something to the autopilot."""
        with contextlib.suppress(OSError):
            if self._stream:
                self._outer.sendall(packet)
            elif self._autopilot is not None:
                self._outer.sendto(packet, self._autopilot)

    def close(self) -> None:
        """Stop."""
        self._closing.set()
        self._thread.join()
        self._outer.close()
        self._inner.close()

    def _run(self) -> None:
        while not self._closing.is_set():
            ready, _, _ = select.select([self._outer, self._inner], [], [], 0.1)
            with contextlib.suppress(OSError):
                if self._outer in ready:
                    content, sender = self._outer.recvfrom(_LARGEST)
                    self._autopilot = sender or self._autopilot
                    # A stream's bytes may be more than a datagram of loopback's can hold.
                    pieces = range(0, len(content) if not self.cut else 0, 8192)
                    for start in pieces:
                        self._inner.sendto(content[start : start + 8192], self._driver)
                if self._inner in ready:
                    content, _ = self._inner.recvfrom(_LARGEST)
                    if not self.cut:
                        self.inject(content)
