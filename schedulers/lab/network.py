"""Networks between edge and cloud: added latency, a bandwidth trace, outages."""

from __future__ import annotations

import math
import random
from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import NormalDist
from typing import Literal, cast

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError, UnknownIdError
from aerodaas.schedulers.analytics.base import MILLISECOND
from aerodaas.schedulers.lab.network_trace import read_bandwidth

__all__ = ["ExecutionTimes", "Network"]


@dataclass(frozen=True, slots=True)
class ExecutionTimes:
    """How long executions take, as a factor on the expected time.

    The factor has the given coefficient of variation. The table's time is its mean or, with
    `quantile` (lognormal only), that quantile: published times are often high percentiles.
    """

    distribution: Literal["nominal", "lognormal", "gamma"] = "nominal"
    variation: float = 0.0
    quantile: float | None = None

    def __post_init__(self) -> None:
        """Raise SchedulerError for figures that make no distribution."""
        if self.distribution not in {"nominal", "lognormal", "gamma"}:
            raise SchedulerError(
                f"execution times are nominal, lognormal or gamma, not {self.distribution!r}"
            )
        if not 0 <= self.variation < math.inf:
            raise SchedulerError(f"a coefficient of variation is >= 0, not {self.variation}")
        if self.quantile is not None and not (
            0 < self.quantile < 1 and self.distribution == "lognormal"
        ):
            raise SchedulerError("a quantile lies between 0 and 1 and goes with lognormal times")

    @classmethod
    def named(cls, text: str) -> ExecutionTimes:
        """Read `nominal`, `lognormal:0.15`, `gamma:0.15` or `lognormal:0.15@0.95`.

        The first figure is the coefficient of variation, the second one the quantile. Raises
        SchedulerError.
        """
        name, _, setting = text.partition(":")
        variation, _, quantile = setting.partition("@")
        try:
            return cls(
                cast("Literal['nominal', 'lognormal', 'gamma']", name),
                float(variation or 0.0),
                float(quantile) if quantile else None,
            )
        except ValueError:
            raise SchedulerError(
                f"times {text!r}: write nominal, lognormal:0.15 or gamma:0.15"
            ) from None

    @property
    def name(self) -> str:
        """As `named` reads it."""
        quantile = "" if self.quantile is None else f"@{self.quantile:g}"
        spread = "" if self.distribution == "nominal" else f":{self.variation:g}{quantile}"
        return f"{self.distribution}{spread}"

    def factors(self, count: int, draw: random.Random) -> list[float]:
        """Draw factors on the expected time, all positive.

        Args:
            count: How many.
            draw: Source of randomness.
        """
        cv = self.variation
        if self.distribution == "nominal" or cv == 0:
            return [1.0] * count
        if self.distribution == "gamma":
            shape = 1 / cv**2
            return [draw.gammavariate(shape, 1 / shape) for _ in range(count)]
        sigma = math.sqrt(math.log1p(cv**2))
        mu = -(sigma**2) / 2
        if self.quantile is not None:
            mu = -sigma * NormalDist().inv_cdf(self.quantile)
        return [draw.lognormvariate(mu, sigma) for _ in range(count)]


Curve = tuple[tuple[int, float], ...]
"""Points (nanoseconds, value), stamps ascending."""


@dataclass(frozen=True, slots=True)
class Network:
    """Effect of the link to the cloud on a task's nominal time there.

    `latency` is in nanoseconds, linear between its points. `bandwidth` is in bytes per second, a
    step function: the time to send `upload` bytes from the start on replaces that at `nominal`
    bandwidth, which the nominal cloud time contains. An execution that overlaps an outage is
    lost. The earliest end over all starts is found at the start or at the end of an outage.
    """

    name: str = "steady"
    latency: Curve = ()
    outages: tuple[tuple[int, int], ...] = ()
    """Begin and end, nanoseconds."""
    bandwidth: Curve = ()
    upload: int = 40_000
    """Bytes of a one-second segment; about 40 kB in the published setup's 25 fps clips."""
    nominal: float = 1_250_000.0
    """10 Mbit/s."""

    @classmethod
    def named(cls, wanted: str, duration: int) -> Network:
        """Make a network from its name; several joined by `+` act together.

        The names: `steady`; `trapezium` or `trapezium:MS` (rises from 0 to +400 ms over the second
        fifth of the duration, falls back over the fourth); `outage` (10 % of the duration from 30 %
        on and 5 % from 70 % on) or `outage:30-45,80-81` (seconds); `trace:FILE` (a measured
        bandwidth: `aerodaas.schedulers.lab.network_trace` has the formats).

        Args:
            wanted: The name.
            duration: Length of the run, nanoseconds.

        Raises:
            UnknownIdError: If there is no network of this name.
            SchedulerError: If a figure or a file of the name is invalid.
        """
        network = cls(wanted)
        for part in wanted.split("+"):
            kind, _, setting = part.partition(":")
            latency, outages, bandwidth = network.latency, network.outages, network.bandwidth
            if kind == "trapezium":
                latency = _trapezium(_number(setting or "400", wanted), duration)
            elif kind == "outage":
                outages = _outages(setting, duration, wanted)
            elif kind == "trace" and setting:
                bandwidth = read_bandwidth(Path(setting), duration)
            elif kind != "steady":
                known = ["steady", "trapezium[:MS]", "outage[:FROM-TO,...]", "trace:FILE"]
                raise UnknownIdError("network", wanted, known)
            network = cls(wanted, latency, outages, bandwidth)
        return network

    @property
    def is_steady(self) -> bool:
        """Whether executions take their nominal time."""
        return not (self.latency or self.outages or self.bandwidth)

    def latency_at(self, stamp: int) -> int:
        """Latency that is added at `stamp`, both in nanoseconds."""
        return int(_linear(self.latency, stamp)) if self.latency else 0

    def bandwidth_at(self, stamp: int) -> float | None:
        """Bytes per second at `stamp`, nanoseconds; None if not given."""
        if not self.bandwidth:
            return None
        return self.bandwidth[max(bisect_right(self.bandwidth, (stamp, float("inf"))) - 1, 0)][1]

    def out_at(self, stamp: int) -> bool:
        """Whether there is no link to the cloud at `stamp`, nanoseconds."""
        return any(begin <= stamp < end for begin, end in self.outages)

    def cloud_time(self, nominal: int, start: int) -> int | None:
        """Time of an execution, nanoseconds; None if it is lost.

        Args:
            nominal: Its time on the undisturbed network, nanoseconds.
            start: When it begins, nanoseconds from the begin of the run.
        """
        taken = nominal
        if self.latency:
            taken += int(_linear(self.latency, start))
        if self.bandwidth:
            transfer = self._transfer(start)
            if transfer is None:
                return None
            taken += transfer - int(self.upload / self.nominal * NANOSECONDS)
            taken = max(taken, 1)
        for begin, end in self.outages:
            if start < end and start + taken > begin:
                return None
        return taken

    def earliest_end(self, nominal: int, start: int) -> int | None:
        """Earliest end of an execution begun at `start` or later, nanoseconds; None without one.

        Args:
            nominal: Its time on the undisturbed network, nanoseconds.
            start: When it may begin, nanoseconds from the begin of the run.
        """
        ends = [
            begin + taken
            for begin in (start, *(end for _, end in self.outages if end > start))
            if (taken := self.cloud_time(nominal, begin)) is not None
        ]
        return min(ends, default=None)

    def _transfer(self, start: int) -> int | None:
        """Nanoseconds to send the upload; None if the trace ends without bandwidth before it is."""
        left = float(self.upload)
        index = max(bisect_right(self.bandwidth, (start, float("inf"))) - 1, 0)
        now = start
        while index + 1 < len(self.bandwidth):
            change = self.bandwidth[index + 1][0]
            room = (change - now) / NANOSECONDS * self.bandwidth[index][1]
            if room >= left:
                break
            left -= room
            index += 1
            now = change
        rate = self.bandwidth[index][1]
        return now - start + int(left / rate * NANOSECONDS) if rate else None


def _linear(curve: Curve, at: int) -> float:
    if at <= curve[0][0]:
        return curve[0][1]
    for (left, low), (right, high) in pairwise(curve):
        if at < right:
            return low + (high - low) * (at - left) / (right - left)
    return curve[-1][1]


def _trapezium(peak: float, duration: int) -> Curve:
    fifth = duration // 5
    return tuple(
        (fifth * corner, height * MILLISECOND)
        for corner, height in ((1, 0.0), (2, peak), (3, peak), (4, 0.0))
    )


def _outages(setting: str, duration: int, wanted: str) -> tuple[tuple[int, int], ...]:
    if not setting:
        tenth = duration // 10
        return ((3 * tenth, 4 * tenth), (7 * tenth, 7 * tenth + tenth // 2))
    spans = []
    for span in setting.split(","):
        begin, _, end = span.partition("-")
        spans.append(
            (int(_number(begin, wanted) * NANOSECONDS), int(_number(end, wanted) * NANOSECONDS))
        )
        if spans[-1][0] >= spans[-1][1]:
            raise SchedulerError(f"network {wanted!r}: the outage {span!r} ends before it begins")
    return tuple(spans)


def _number(text: str, wanted: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise SchedulerError(f"network {wanted!r}: {text!r} is no number") from None
