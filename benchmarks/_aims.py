"""What the project wants to reach, by benchmark, case and figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase

__all__ = ["AIMS", "Aim", "Key", "aim_of"]

Key = tuple[str, str, str]
"""Benchmark, case and figure."""


@dataclass(frozen=True)
class Aim:
    """A limit of one figure."""

    benchmark: str
    case: str
    """Name of the case, or a pattern of several, as of files."""
    figure: str
    limit: float
    """In the figure's own unit; with `of`, a factor of that case's."""
    least: bool = False
    """True if the figure should be at least so much, not at most."""
    of: str = ""
    """Case whose same figure the limit is multiplied by."""

    def meant(self, key: Key) -> bool:
        """True if the aim is this figure's."""
        benchmark, case, figure = key
        same = benchmark == self.benchmark and figure == self.figure
        return same and fnmatchcase(case, self.case)

    def bound(self, figures: Mapping[Key, float]) -> float | None:
        """The limit in the figure's unit; None where the other case has not been measured."""
        if not self.of:
            return self.limit
        other = figures.get((self.benchmark, self.of, self.figure))
        return None if other is None else self.limit * other

    def met(self, value: float, bound: float) -> bool:
        """True if `value` is within the bound."""
        return value >= bound if self.least else value <= bound


_OURS, _DORA = "AeroDaaS, one node", "dora, one node"
_FAR = "AeroDaaS, analysis on a second Ray node"

AIMS = (
    Aim("latency", _OURS, "median", 0.5, of=_DORA),
    Aim("latency", _OURS, "p99", 0.5, of=_DORA),
    Aim("latency", _OURS, "cpu", 1.0, of=_DORA),
    Aim("latency", _FAR, "median", 5.0),
    Aim("footprint", "camera, all processes", "memory", 450.0),
    Aim("footprint", "hover, all processes", "in flight", 3.0),
    Aim("start", "command to take-off", "median", 3.0),
    Aim("start", "import aerodaas", "median", 0.15),
    Aim("start", "aerodaas --help", "median", 0.3),
    Aim("simulation", "as the app is", "factor", 30.0, least=True),
    Aim("simulation", "no camera", "factor", 300.0, least=True),
    Aim("lab", "* 80D-A/7 300 s", "time", 1.0),
    Aim("decision", "margin 100", "mean", 20.0),
    Aim("vision", "detector.onnx", "total", 15.0),
)


def aim_of(key: Key) -> Aim | None:
    """The aim of a figure, if it has one."""
    return next((aim for aim in AIMS if aim.meant(key)), None)
