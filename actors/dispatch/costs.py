"""Costs of a node: the round trip by message size, and the execution of each analysis.

All of it is observed, in seconds of the host; a few newest observations count, so that estimates
follow the network, and quantiles rather than means, so that one odd value does not move them.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence

__all__ = ["ExecutionEstimates", "LinkEstimate", "Uplink", "quantile"]

_KEPT = 11
_LINK_KEPT = 5
_LARGE = 16384
"""Size in bytes from which a transfer measures bandwidth, and below which latency."""
_SURE = 0.9
"""Quantile of the execution times that one may count on."""


def quantile(values: Sequence[float], share: float) -> float:
    """The smallest of `values` that at least `share` of them, 0 to 1, do not exceed."""
    ordered = sorted(values)
    place = -int(-share * len(ordered) // 1) - 1
    return ordered[max(0, min(len(ordered) - 1, place))]


class LinkEstimate:
    """Round trip to a node: `seconds = latency + size / bandwidth`. Threads may share it."""

    def __init__(self) -> None:
        self._latencies: deque[float] = deque(maxlen=_LINK_KEPT)
        self._transfers: deque[tuple[int, float]] = deque(maxlen=_LINK_KEPT)

    def observe(self, size: int, seconds: float) -> None:
        """Learn from `size` bytes that were there and answered after `seconds`."""
        if size < _LARGE:
            self._latencies.append(max(0.0, seconds))
        else:
            self._transfers.append((size, seconds))

    def forget(self) -> None:
        """Discard the estimate of the bandwidth, which was found wrong."""
        self._transfers.clear()

    @property
    def latency(self) -> float:
        """Seconds that an empty message takes there and back; 0 before the first one did."""
        known = tuple(self._latencies)
        return quantile(known, 0.5) if known else 0.0

    @property
    def bandwidth(self) -> float:
        """Bytes per second; infinite before anything large was sent."""
        # Of the latency as it is known now: a link that changes is not explained twice.
        latency = self.latency
        known = [size / max(1e-6, seconds - latency) for size, seconds in tuple(self._transfers)]
        return quantile(known, 0.5) if known else float("inf")

    def seconds(self, size: float) -> float:
        """Expected seconds from sending `size` bytes until a small answer, without any work."""
        return self.latency + size / self.bandwidth


class Uplink:
    """Transfers under way on a link that carries one after another. Threads may share it."""

    def __init__(self, link: LinkEstimate, clock: Callable[[], float] = time.perf_counter) -> None:
        """Estimate `link` from its transfers; `clock` gives the seconds of `depart`."""
        self._link = link
        self._clock = clock
        self._under_way: dict[object, tuple[float, float, float]] = {}
        self._arrived = float("-inf")

    @property
    def waiting(self) -> float:
        """Bytes ahead of the next transfer."""
        return sum(size for size, _, _ in tuple(self._under_way.values()))

    def seconds(self, size: float) -> float:
        """Expected seconds from sending `size` bytes now until a small answer, without any work."""
        ahead = size + self.waiting
        return max(self._link.seconds(ahead), self._link.latency + ahead / self._at_most())

    def _at_most(self) -> float:
        """Bytes per second that the link has at most, or the oldest would have arrived.

        So a link that has become slow is known as one before anything has crossed it.
        """
        under_way = tuple(self._under_way.values())
        if not under_way:
            return float("inf")
        size, departed, work = under_way[0]
        crossing = self._clock() - max(departed, self._arrived) - work - self._link.latency
        return size / crossing if crossing > 0 else float("inf")

    def depart(self, name: object, size: float, at: float, work: float = 0.0) -> None:
        """Something of so many bytes is handed to the link at `at`, seconds.

        Its answer takes `work` seconds more than the round trip.
        """
        self._under_way[name] = size, at, work

    def arrive(self, name: object, at: float) -> None:
        """Record a transfer answered, less the work, at `at`, and estimate the link from it.

        What it waited for others is theirs: counted twice, a queue would look like a slow link.
        """
        size, departed, _ = self._under_way.pop(name, (0.0, at, 0.0))
        queued = self._arrived > departed
        taken = at - max(departed, self._arrived) + (self._link.latency if queued else 0.0)
        self._arrived = max(self._arrived, at)
        self._link.observe(round(size), taken)

    def lose(self, name: object) -> None:
        """It will not arrive any more."""
        self._under_way.pop(name, None)


class ExecutionEstimates:
    """How long each analysis works on one item at one place."""

    def __init__(self) -> None:
        self._seen: dict[str, deque[float]] = {}

    def observe(self, model: str, seconds: float) -> None:
        """Learn from one execution."""
        self._seen.setdefault(model, deque(maxlen=_KEPT)).append(seconds)

    def seconds(self, model: str) -> float | None:
        """Seconds that one may count on; None before the first execution."""
        seen = self._seen.get(model)
        return quantile(seen, _SURE) if seen else None
