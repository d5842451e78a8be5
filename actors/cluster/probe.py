"""Probe actor of a cluster node: its versions and resources, and its link to another node."""

from __future__ import annotations

import os
import platform
import statistics
import time
from dataclasses import dataclass
from typing import Any

import ray

import aerodaas
from aerodaas.clock import host_time_ns

__all__ = ["LinkMeasurement", "NodeFacts", "Probe", "clock_offset"]

_ROUND_TRIPS = 15
_BYTES = 1_000_000
_TRANSFERS = 3


@dataclass(frozen=True)
class NodeFacts:
    """Versions and resources of one node."""

    host: str
    python: str
    ray: str
    aerodaas: str
    cores: int
    memory: int
    """Memory in bytes."""


@dataclass(frozen=True)
class LinkMeasurement:
    """Measurement of the link from one node to another."""

    rtt: float
    """Median round trip of a call in seconds, Ray's overhead included."""
    offset: float
    """Seconds by which the other clock is ahead."""
    uncertainty: float
    """Error bound of the offset in seconds: half the shortest round trip."""
    up: float
    """Bits per second to the other node."""
    down: float
    """Bits per second from the other node."""


class Probe:
    """Probe actor, one per node."""

    def facts(self) -> NodeFacts:
        """Versions and resources of this node."""
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
        """Host time of this node, nanoseconds since the epoch."""
        return host_time_ns()

    def receive(self, data: bytes) -> int:
        """Receive a transfer and return its size."""
        return len(data)

    def give(self, size: int) -> bytes:
        """Return `size` random bytes, which no link can compress."""
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
            self._rate(rtt, lambda: other.receive.remote(ray.put(data))) for _ in range(_TRANSFERS)
        )
        down = max(self._rate(rtt, lambda: other.give.remote(_BYTES)) for _ in range(_TRANSFERS))
        return LinkMeasurement(rtt, offset, uncertainty, up, down)

    @staticmethod
    def _rate(rtt: float, transfer: Any) -> float:  # noqa: ANN401
        began = time.perf_counter()
        ray.get(transfer())
        return _BYTES * 8 / max(1e-6, time.perf_counter() - began - rtt)


def clock_offset(readings: list[tuple[int, int, int]]) -> tuple[float, float]:
    """Seconds by which the other clock is ahead, and the error bound.

    `readings` are (sent, the other's time, received) in nanoseconds. The shortest round trip is
    the most accurate, as in NTP (RFC 5905, section 10).
    """
    sent, theirs, received = min(readings, key=lambda reading: reading[2] - reading[0])
    return (theirs - (sent + received) / 2) / 1e9, (received - sent) / 2e9
