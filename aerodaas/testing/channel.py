"""Simulated radio link on loopback: lost, late, duplicated or garbled packets, by seed."""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable
from dataclasses import dataclass

__all__ = ["Channel", "Impairment"]


@dataclass(frozen=True)
class Impairment:
    """Impairments of a radio link's packets: shares of 0 to 1, seconds."""

    loss: float = 0.0
    duplicates: float = 0.0
    late: float = 0.0
    """Share of the packets that come `lateness` seconds after the others."""
    lateness: float = 1.0
    delay: float = 0.0
    jitter: float = 0.0
    """Uniform jitter from 0 to this, added to `delay`; packets may overtake each other."""
    garbled: float = 0.0
    """Share in which bytes are replaced or cut off."""


class Channel:
    """Queue of delayed packets; `deliver` is called with each that arrives."""

    def __init__(
        self,
        impairment: Impairment,
        seed: str,
        deliver: Callable[[bytes, tuple[str, int]], None],
    ) -> None:
        """Impair packets by `impairment`, drawn from `seed`."""
        self.impairment = impairment
        """May be changed in between."""
        self._random = random.Random(seed)
        self._deliver = deliver
        self._waiting: list[tuple[float, int, bytes, tuple[str, int]]] = []
        self._count = 0
        self.lost = 0

    def send(self, content: bytes, peer: tuple[str, int], now: float) -> None:
        """Queue a packet at `now` seconds; one without delay is delivered at once."""
        bad, draw = self.impairment, self._random.random
        if draw() < bad.loss:
            self.lost += 1
            return
        for _ in range(2 if draw() < bad.duplicates else 1):
            due = now + bad.delay + bad.jitter * draw()
            if draw() < bad.late:
                due += bad.lateness
            if draw() < bad.garbled:
                content = self._garble(content)
            if due <= now:
                self._deliver(content, peer)
                continue
            self._count += 1
            heapq.heappush(self._waiting, (due, self._count, content, peer))

    def deliver(self, now: float) -> None:
        """Deliver the packets due at `now` seconds."""
        while self._waiting and self._waiting[0][0] <= now:
            _, _, content, peer = heapq.heappop(self._waiting)
            self._deliver(content, peer)

    def _garble(self, content: bytes) -> bytes:
        cut = bytearray(content[: self._random.randint(0, len(content) // 2)])
        for _ in range(min(len(cut), self._random.randint(0, 3))):
            cut[self._random.randrange(len(cut))] = self._random.randrange(256)
        return bytes(cut)
