"""Probe of a cluster's node: its own properties, and its link to another node."""

from __future__ import annotations

import os
import platform
import statistics
import time
from dataclasses import dataclass
from typing import Any

import ray

import aerodaas
from aerodaas.types.clock import host_time_ns

__all__ = ["LinkMeasurement", "NodeFacts", "Probe", "clock_offset"]

_ROUND_TRIPS = 15
_BYTES = 1_000_000
_TRANSFERS = 3


@dataclass(frozen=True)
class NodeFacts:
    """One node's versions and means."""

    host: str
    python: str
    ray: str
    aerodaas: str
    cores: int
    memory: int
    """Bytes."""


@dataclass(frozen=True)
class LinkMeasurement:
    """From one node to another and back."""

    rtt: float
    """Median seconds of a call and its answer, Ray's own share included."""
    offset: float
    """Seconds that the other clock is ahead."""
    uncertainty: float
    """Seconds by which the offset may be wrong: half the shortest round trip."""
    up: float
    """Bits per second there."""
    down: float
    """Bits per second back."""


class Probe:
    """An actor on each node."""

    def facts(self) -> NodeFacts:
        """Of this node."""
        from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415 - only here

        import psutil  # noqa: PLC0415 - only here

        try:
            ours = version("aerodaas")
        except PackageNotFoundError:
            ours = f"not installed ({aerodaas.__name__} is imported from a folder)"
        memory = psutil.virtual_memory().total
        cores = os.cpu_count() or 1
        return NodeFacts(
            platform.node(), platform.python_version(), ray.__version__, ours, cores, memory
        )

    def now(self) -> int:
        """The clock of this node, nanoseconds since the epoch."""
        return host_time_ns()

    def take(self, data: bytes) -> int:
        """Take a transfer."""
        return len(data)

    def give(self, size: int) -> bytes:
        """Send so many bytes that no link can compress."""
        return os.urandom(size)

    def measure(self, other: Any) -> LinkMeasurement:  # noqa: ANN401 - an actor's handle
        """Measure the link to another node's probe."""
        ray.get(other.now.remote())  # the first call also makes the connection
        readings = []
        for _ in range(_ROUND_TRIPS):
            sent = host_time_ns()
            theirs = ray.get(other.now.remote())
            readings.append((sent, theirs, host_time_ns()))
        offset, uncertainty = clock_offset(readings)
        rtt = statistics.median(back - sent for sent, _, back in readings) / 1e9
        data = self.give(_BYTES)
        up = max(
            self._rate(rtt, lambda: other.take.remote(ray.put(data))) for _ in range(_TRANSFERS)
        )
        down = max(self._rate(rtt, lambda: other.give.remote(_BYTES)) for _ in range(_TRANSFERS))
        return LinkMeasurement(rtt, offset, uncertainty, up, down)

    @staticmethod
    def _rate(rtt: float, transfer: Any) -> float:  # noqa: ANN401
        began = time.perf_counter()
        ray.get(transfer())
        return _BYTES * 8 / max(1e-6, time.perf_counter() - began - rtt)


def clock_offset(readings: list[tuple[int, int, int]]) -> tuple[float, float]:
    """Seconds that the other clock is ahead, and by how much that may be wrong.

    `readings` are (sent, the other's time, received) in nanoseconds. Of all round trips the
    shortest says most, as in NTP (RFC 5905, section 10).
    """
    sent, theirs, received = min(readings, key=lambda reading: reading[2] - reading[0])
    return (theirs - (sent + received) / 2) / 1e9, (received - sent) / 2e9
