"""What a link does to what crosses it, in the words of a command line."""

from __future__ import annotations

import re
from dataclasses import dataclass

from aerodaas.errors import ConfigError

__all__ = ["Shape", "parse_bandwidth", "parse_time"]

_TIMES = {"us": 1e-6, "ms": 1e-3, "s": 1.0}
_RATES = {"kbit": 1e3, "mbit": 1e6, "gbit": 1e9}


@dataclass(frozen=True)
class Shape:
    """One link between edge and cloud, the same in both directions."""

    rtt: float = 0.0
    """Seconds that a packet takes there and back, beside what it waits for bandwidth."""
    bandwidth: float | None = None
    """Bits per second each way; None: as fast as the machine goes."""
    loss: float = 0.0
    """Share of the packets that is lost, each way."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.rtt < float("inf"):
            raise ConfigError(f"a round trip takes 0 s or more, not {self.rtt:g} s")
        if self.bandwidth is not None and not 0.0 < self.bandwidth < float("inf"):
            raise ConfigError("a bandwidth is more than 0 bit/s; cut a link off instead")
        if not 0.0 <= self.loss <= 1.0:
            raise ConfigError(f"a loss lies between 0 and 1, not at {self.loss:g}")


def parse_time(text: str) -> float:
    """Seconds of `40ms`, `0.5s` or `200us`; raises ConfigError."""
    return _parse(text, _TIMES, "a time", "40ms")


def parse_bandwidth(text: str) -> float:
    """Bits per second of `50mbit`, `800kbit` or `1gbit`; raises ConfigError."""
    return _parse(text, _RATES, "a bandwidth", "50mbit")


def _parse(text: str, units: dict[str, float], what: str, example: str) -> float:
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([a-z]+)", text.strip().lower())
    if match is None or match[2] not in units:
        raise ConfigError(f"{what} is written as {example}, with {', '.join(units)}; not {text!r}")
    return float(match[1]) * units[match[2]]
