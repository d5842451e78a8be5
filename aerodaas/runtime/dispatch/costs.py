"""Cost estimates of a node: transfer time by size, execution time of each analysis, and overhead.

All are measured in seconds of the host. Only a few newest samples are used, so that estimates
follow the network, and quantiles rather than means, because they are robust to outliers.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

from aerodaas.clock import NANOSECONDS
from aerodaas.messages.envelope import Message
from aerodaas.schedulers.analytics.base import MILLISECOND, Profile

__all__ = [
    "DeadlineReserve",
    "Estimates",
    "ExecutionEstimates",
    "LinkEstimate",
    "Uplink",
    "quantile",
]

_KEPT = 11
_LINK_KEPT = 5
_LARGE = 16384
"""Bytes from which a transfer measures the bandwidth; smaller ones measure the latency."""
_SURE = 0.9
"""Quantile of the execution times used as the estimate."""


def quantile(values: Sequence[float], share: float) -> float:
    """Smallest of `values` that at least a share of them do not exceed.

    Args:
        values: At least one value.
        share: 0 to 1.
    """
    ordered = sorted(values)
    place = -int(-share * len(ordered) // 1) - 1
    return ordered[max(0, min(len(ordered) - 1, place))]


class LinkEstimate:
    """Round trip time to a node: `seconds = latency + size / bandwidth`. Thread-safe."""

    def __init__(self) -> None:
        self._latencies: deque[float] = deque(maxlen=_LINK_KEPT)
        self._transfers: deque[tuple[int, float]] = deque(maxlen=_LINK_KEPT)

    def observe(self, size: int, seconds: float) -> None:
        """Add a sample.

        Args:
            size: Bytes that were sent.
            seconds: Time until the answer.
        """
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
        """Add a transfer.

        Args:
            name: Key of the transfer, for `arrive`.
            size: Bytes.
            at: When it starts, seconds.
            work: Execution that its answer takes in addition to the round trip, seconds.
        """
        self._under_way[name] = size, at, work

    def arrive(self, name: object, at: float) -> None:
        """Complete a transfer, and add a sample to the link.

        Queueing behind other transfers is excluded: otherwise a queue would look like a slow link.

        Args:
            name: Key of the transfer, as `depart` was given it.
            at: When it was answered, less its execution, seconds.
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
        """Add the execution time of one item.

        Args:
            model: Stream of the analysis.
            seconds: The execution time.
        """
        self._seen.setdefault(model, deque(maxlen=_KEPT)).append(seconds)

    def seconds(self, model: str) -> float | None:
        """Conservative estimate in seconds; None before the first execution."""
        seen = self._seen.get(model)
        return quantile(seen, _SURE) if seen else None


_WORTH_TELLING = 0.05
"""Relative difference of a measured time from which the profile is updated."""


class Estimates:
    """Profiles whose times follow the measurements if the user gave none."""

    def __init__(self, speed: float, learnt: frozenset[str]) -> None:
        """Create the estimates for mission seconds per wall second `speed`.

        The times named in `learnt` are left to the scheduler, which learns them itself: otherwise
        they would be corrected twice.
        """
        self.edge = ExecutionEstimates()
        self._second = speed * NANOSECONDS
        self._learnt = learnt
        self._told: dict[str, Profile] = {}

    def profile(
        self,
        told: Profile,
        open_times: frozenset[str],
        cloud: float | None,
        link: float = 0.0,
    ) -> Profile:
        """Profile for a new task of an analysis.

        Args:
            told: The environment file's profile.
            open_times: Those of its times that are measured.
            cloud: Expected time of the cloud, host seconds; None if not known.
            link: The transfer alone of a frame sent now, host seconds: a lower bound of the cloud
                time.
        """
        profile = self._told.setdefault(told.model, told)
        wanted = open_times - self._learnt
        edge = self._time(self.edge.seconds(told.model) if "edge_time" in wanted else None)
        there = self._time(cloud if "cloud_time" in wanted else None)
        if there is None and "cloud_time" not in self._learnt and "cloud_time" not in open_times:
            there = max(told.cloud_time, round(link * self._second))
        news = replace(
            profile,
            edge_time=edge or profile.edge_time,
            cloud_time=there or profile.cloud_time,
        )
        times = ((profile.edge_time, news.edge_time), (profile.cloud_time, news.cloud_time))
        if any(abs(new - old) > _WORTH_TELLING * old for old, new in times):
            profile = self._told[told.model] = news
        return profile

    def _time(self, seconds: float | None) -> int | None:
        """Mission nanoseconds of a duration in host seconds; at least a millisecond."""
        return None if seconds is None else max(MILLISECOND, round(seconds * self._second))


_OVERHEADS_KEPT = 200
_ENOUGH = 20
"""Samples before the measurements are used."""
_AT_FIRST = 5 * MILLISECOND
_QUANTILE = 0.95
_LARGEST_SHARE = 0.1
"""Largest fraction of a task's deadline held in reserve."""


class DeadlineReserve:
    """Measured overhead, by which the deadlines given to every scheduler are shortened.

    Tables of execution times and simulators do not include messages and thread switches. A
    scheduler that defers to the last moment would miss deadlines by them, so each task's deadline
    is moved forward by a high quantile of the recent overhead; results are judged by the true
    deadline.
    """

    def __init__(self) -> None:
        self._ways: deque[int] = deque(maxlen=_OVERHEADS_KEPT)
        self._delays: deque[int] = deque(maxlen=_OVERHEADS_KEPT)
        self._reserve = _AT_FIRST
        self._news = 0

    def travelled(self, answer: Message[object], taken: int) -> None:
        """Add an execution on the edge.

        Args:
            answer: Its answer, whose last span is the work.
            taken: Time from sending the task to the answer, nanoseconds.
        """
        work = answer.spans[-1].published - answer.spans[-1].received
        self._ways.append(max(0, taken - work))
        self._refresh()

    def delayed(self, late: int) -> None:
        """Add a timer that was `late` nanoseconds late."""
        self._delays.append(max(0, late))
        self._refresh()

    def reserve(self, deadline: int) -> int:
        """Nanoseconds to subtract from a relative deadline."""
        return min(self._reserve, int(_LARGEST_SHARE * deadline))

    def _refresh(self) -> None:
        self._news += 1
        if self._news >= _ENOUGH and len(self._ways) >= _ENOUGH:
            self._news = 0
            self._reserve = _high(self._ways) + _high(self._delays)


def _high(samples: deque[int]) -> int:
    return sorted(samples)[int(_QUANTILE * (len(samples) - 1))] if samples else 0
