"""A wire in user space: delays and loses packets between two TAP devices.

For kernels without netem. This file runs as a process of its own, so it imports nothing but the
standard library. It is given the names of the two devices; its standard input takes settings as
lines of JSON, `{"delay": 0.02, "loss": 0.01}` for each direction, and ends it when closed. The
devices vanish with it.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import random
import select
import struct
import sys
import time
from collections import deque

__all__ = ["RelayDirection", "main"]

_TUNSETIFF = 0x400454CA
_IFF_TAP = 0x0002
_IFF_NO_PI = 0x1000
_PACKET = 65536
_BATCH = 64
"""Packets taken from one end before the other is looked at."""
_ROOM = 4096
"""Packets under way in one direction; more are lost, as in any router."""


class RelayDirection:
    """One direction: a queue in which every packet waits for `delay` seconds."""

    def __init__(self, source: int, sink: int, seed: int = 0) -> None:
        """Carry packets from one file descriptor to another."""
        self.source = source
        self.sink = sink
        self.delay = 0.0
        self.loss = 0.0
        self._under_way: deque[tuple[float, bytes]] = deque()
        self._random = random.Random(seed)

    def take(self, now: float) -> None:
        """Take what waits at the source."""
        for _ in range(_BATCH):
            try:
                packet = os.read(self.source, _PACKET)
            except BlockingIOError:
                return
            full = len(self._under_way) >= _ROOM
            if not full and self._random.random() >= self.loss:
                # A shorter delay does not let a packet overtake those before it.
                before = self._under_way[-1][0] if self._under_way else 0.0
                self._under_way.append((max(before, now + self.delay), packet))

    def give(self, now: float) -> None:
        """Hand over what has been under way for long enough."""
        while self._under_way and self._under_way[0][0] <= now:
            packet = self._under_way.popleft()[1]
            # A device that is down takes nothing; the packet is lost.
            with contextlib.suppress(OSError):
                os.write(self.sink, packet)

    @property
    def due(self) -> float | None:
        """When the next packet is due; None if none is under way."""
        return self._under_way[0][0] if self._under_way else None


def _tap(name: str) -> int:
    descriptor = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    request = struct.pack("16sH14x", name.encode(), _IFF_TAP | _IFF_NO_PI)
    fcntl.ioctl(descriptor, _TUNSETIFF, request)
    return descriptor


def _run(wires: tuple[RelayDirection, RelayDirection], control: int) -> None:
    sources = [wire.source for wire in wires]
    rest = b""
    while True:
        dues = [wire.due for wire in wires if wire.due is not None]
        timeout = max(0.0, min(dues) - time.monotonic()) if dues else None
        readable, _, _ = select.select([*sources, control], [], [], timeout)
        if control in readable:
            told = os.read(control, 4096)
            if not told:
                return
            *lines, rest = (rest + told).split(b"\n")
            for line in lines:
                settings = json.loads(line)
                for wire in wires:
                    wire.delay, wire.loss = settings["delay"], settings["loss"]
        now = time.monotonic()
        for wire in wires:
            if wire.source in readable:
                wire.take(now)
            wire.give(now)


def main() -> None:
    """Relay between the two devices named on the command line until standard input closes."""
    ends = [_tap(name) for name in sys.argv[1:3]]
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    _run(
        (RelayDirection(ends[0], ends[1], seed=1), RelayDirection(ends[1], ends[0], seed=2)),
        sys.stdin.fileno(),
    )


if __name__ == "__main__":
    main()
