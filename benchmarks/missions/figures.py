"""The figures of a flight that the paper gives, too."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from missions.catalogue import Mission
from missions.evidence import Evidence

__all__ = ["Figures", "lines_of_code"]

_SETTLED = 5.0
"""Seconds after which a height counts as held."""


@dataclass(frozen=True, slots=True)
class Figures:
    """Measured on one recording; NaN where the mission has no such thing."""

    duration: float
    distance: float
    height: tuple[float, float]
    """Metres within which 95 % of the working time was spent."""
    latency: float
    """Milliseconds from a frame's capture to the command made from it, median."""
    overhead: float
    """Its part in which neither a network ran nor results were processed, median."""

    @classmethod
    def of(cls, mission: Mission, recording: Path) -> Figures:
        """Measure a recording."""
        evidence = Evidence.read(recording)
        working = evidence.during(*mission.working, settled=_SETTLED)
        heights = evidence.position[working, 2]
        low, high = np.percentile(heights, [2.5, 97.5]) if len(heights) else (np.nan, np.nan)
        latency, overhead = _latency(evidence)
        return cls(
            evidence.duration, evidence.distance, (float(low), float(high)), latency, overhead
        )


def _latency(evidence: Evidence) -> tuple[float, float]:
    """Of the stream that flies the drone: the one that has most to do."""
    streams = [
        latency
        for name, latency in evidence.flight.latencies.items()
        if name.endswith(("_follow", "_inspection"))
    ]
    if not streams:
        return float("nan"), float("nan")
    (stream,) = streams
    return float(np.median(stream.total)), float(np.median(stream.overhead))


def lines_of_code(path: Path) -> int:
    """Lines that hold code: no blank ones, no comments, no docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    texts = {
        line
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    lines = path.read_text(encoding="utf-8").splitlines()
    used = {
        number
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.strip().startswith("#") and number not in texts
    }
    return len(used)
