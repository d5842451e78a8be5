"""A relay between an autopilot and the driver, which can be cut and spoilt, and is read along."""

from __future__ import annotations

import contextlib
import select
import socket
import threading
import time

from aerodaas.testing.channel import Channel, Impairment
from sitl.witness import Witness

__all__ = ["Relay"]

_LARGEST = 65535
_TURN = 0.02


class Relay:
    """Passes packets both ways between the autopilot's `url` and its own."""

    def __init__(self, url: str, port: int = 0) -> None:
        """Open both ends; `url` is `udpin:` or `tcp:`, as the driver would take it.

        The driver meets it at `port` of loopback; at a free one without.
        """
        kind, host, number = url.split(":")
        self._peer = (host, int(number))
        self._stream = kind == "tcp"
        self._autopilot: tuple[str, int] | None = None
        self._outer: socket.socket | None = None
        self._reach()
        self._inner = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._inner.bind(("127.0.0.1", 0))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", port))
            self._driver: tuple[str, int] = probe.getsockname()
        self.url = f"udpin:127.0.0.1:{self._driver[1]}"
        """Where the driver meets it."""
        self.witness = Witness(self.inject)
        """Reads what the autopilot says, whatever becomes of it on the way."""
        self._up = Channel(Impairment(), "up", lambda content, _: self.inject(content))
        self._down = Channel(Impairment(), "down", self._pass_down)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def spoil(self, impairment: Impairment) -> None:
        """Do this to the packets of both ways from now on."""
        self._up.impairment = self._down.impairment = impairment

    def cut(self, *, off: bool = True) -> None:
        """Lose everything, both ways, or nothing any more."""
        self.spoil(Impairment(loss=1.0 if off else 0.0))

    def inject(self, packet: bytes) -> None:
        """Say something to the autopilot."""
        outer = self._outer
        with contextlib.suppress(OSError):
            if outer is not None and self._stream:
                outer.sendall(packet)
            elif outer is not None and self._autopilot is not None:
                outer.sendto(packet, self._autopilot)

    def say(self, packet: bytes) -> None:
        """Say something to the driver, as from the autopilot's wire."""
        self._pass_down(packet, self._driver)

    def close(self) -> None:
        """Stop."""
        self._closing.set()
        self._thread.join()
        self._inner.close()
        if self._outer is not None:
            self._outer.close()

    def _reach(self) -> None:
        """Open the way to the autopilot; a stream ends when it is started anew."""
        if self._outer is not None:
            self._outer.close()
            self._outer = None
        if not self._stream:
            self._outer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._outer.bind(self._peer)
            return
        with contextlib.suppress(OSError):
            self._outer = socket.create_connection(self._peer, timeout=1.0)

    def _run(self) -> None:
        while not self._closing.is_set():
            if self._outer is None:
                time.sleep(0.1)
                self._reach()
            ends = [end for end in (self._outer, self._inner) if end is not None]
            ready, _, _ = select.select(ends, [], [], _TURN)
            now = time.monotonic()
            if self._outer in ready:
                self._hear(now)
            if self._inner in ready:
                with contextlib.suppress(OSError):
                    self._up.send(self._inner.recv(_LARGEST), self._driver, now)
            self._up.deliver(now)
            self._down.deliver(now)

    def _hear(self, now: float) -> None:
        assert self._outer is not None
        try:
            content, sender = self._outer.recvfrom(_LARGEST)
        except OSError:
            content, sender = b"", None
        if not content and self._stream:
            self._reach()
            return
        self._autopilot = sender or self._autopilot
        for packet in self.witness.take(content):
            self._down.send(packet, self._driver, now)

    def _pass_down(self, content: bytes, driver: tuple[str, int]) -> None:
        with contextlib.suppress(OSError):
            self._inner.sendto(content, driver)
