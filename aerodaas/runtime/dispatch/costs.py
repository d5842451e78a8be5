"""Cost estimates of a node: transfer time by size, and execution time of each analysis.

All are measured in seconds of the host. Only a few newest samples are used, so that estimates
follow the network, and quantiles rather than means, because they are robust to outliers.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence

__all__ = ["ExecutionEstimates", "LinkEstimate", "Uplink", "quantile"]

_KEPT = 11
_LINK_KEPT = 5
_LARGE = 16384
"""Bytes from which a transfer measures the bandwidth; smaller ones measure the latency."""
_SURE = 0.9
"""Quantile of the execution times used as the estimate."""


def quantile(values: Sequence[float], share: float) -> float:
    """Smallest of `values` that at least the fraction `share`, 0 to 1, of them do not exceed."""
    ordered = sorted(values)
    place = -int(-share * len(ordered) // 1) - 1
    return ordered[max(0, min(len(ordered) - 1, place))]


class LinkEstimate:
    """Round trip time to a node: `seconds = latency + size / bandwidth`. Thread-safe."""

    def __init__(self) -> None:
        self._latencies: deque[float] = deque(maxlen=_LINK_KEPT)
        self._transfers: deque[tuple[int, float]] = deque(maxlen=_LINK_KEPT)

    def observe(self, size: int, seconds: float) -> None:
        """Add a sample: `size` bytes were sent and answered after `seconds`."""
        if size < _LARGE:
            self._latencies.append(max(0.0, seconds))
        else:
            self._transfers.append((size, seconds))

    def forget(self) -> None:
        """Discard the samples of the bandwidth, which have turned out to be wrong."""
        self._transfers.clear()

    @property
    def latency(self) -> float:
        """Round trip of an empty message in seconds; 0 before the first sample."""
        known = tuple(self._latencies)
        return quantile(known, 0.5) if known else 0.0

    @property
    def bandwidth(self) -> float:
        """Bytes per second; infinite before the first large transfer."""
        # With the current latency, so that a change of the link is not counted twice.
        latency = self.latency
        known = [size / max(1e-6, seconds - latency) for size, seconds in tuple(self._transfers)]
        return quantile(known, 0.5) if known else float("inf")

    def seconds(self, size: float) -> float:
        """Expected seconds from sending `size` bytes until a small answer, without execution."""
        return self.latency + size / self.bandwidth


class Uplink:
    """Queue of transfers on a link that carries one after another. Thread-safe."""

    def __init__(self, link: LinkEstimate, clock: Callable[[], float] = time.perf_counter) -> None:
        """Create the queue of `link`, which gets samples; `clock` is that of `depart`, seconds."""
        self._link = link
        self._clock = clock
        self._under_way: dict[object, tuple[float, float, float]] = {}
        self._arrived = float("-inf")

    @property
    def waiting(self) -> float:
        """Bytes queued before a transfer that starts now."""
        return sum(size for size, _, _ in tuple(self._under_way.values()))

    def seconds(self, size: float) -> float:
        """Expected seconds from sending `size` bytes now until a small answer, no execution."""
        ahead = size + self.waiting
        return max(self._link.seconds(ahead), self._link.latency + ahead / self._at_most())

    def _at_most(self) -> float:
        """Upper bound of the bandwidth in bytes per second, from the oldest unfinished transfer.

        It detects a link that has become slow before a transfer has completed.
        """
        under_way = tuple(self._under_way.values())
        if not under_way:
            return float("inf")
        size, departed, work = under_way[0]
        crossing = self._clock() - max(departed, self._arrived) - work - self._link.latency
        return size / crossing if crossing > 0 else float("inf")

    def depart(self, name: object, size: float, at: float, work: float = 0.0) -> None:
        """Add a transfer of `size` bytes that starts at `at`, seconds.

        Its answer takes `work` seconds of execution in addition to the round trip.
        """
        self._under_way[name] = size, at, work

    def arrive(self, name: object, at: float) -> None:
        """Complete a transfer, answered at `at` less its execution, and add a sample to the link.

        Queueing behind other transfers is excluded: otherwise a queue would look like a slow
        link.
        """
        size, departed, _ = self._under_way.pop(name, (0.0, at, 0.0))
        queued = self._arrived > departed
        taken = at - max(departed, self._arrived) + (self._link.latency if queued else 0.0)
        self._arrived = max(self._arrived, at)
        self._link.observe(round(size), taken)

    def lose(self, name: object) -> None:
        """Remove a transfer that will not be answered."""
        self._under_way.pop(name, None)


class ExecutionEstimates:
    """Execution time of each analysis per item on one executor."""

    def __init__(self) -> None:
        self._seen: dict[str, deque[float]] = {}

    def observe(self, model: str, seconds: float) -> None:
        """Add the execution time of one item."""
        self._seen.setdefault(model, deque(maxlen=_KEPT)).append(seconds)

    def seconds(self, model: str) -> float | None:
        """Conservative estimate in seconds; None before the first execution."""
        seen = self._seen.get(model)
        return quantile(seen, _SURE) if seen else None
