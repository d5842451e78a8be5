"""Metrics of a run, and whether one scheduler's are better than another's.

Schedulers are compared in pairs over the seeds, as both saw the same paths. Intervals are
Student's t over the differences. Tests are sign-flip permutation tests for paired
samples (Fisher 1935, Pitman 1937), which assume no distribution: were the two schedulers alike,
each seed's difference could as well have the other sign. Several comparisons are corrected by
Holm's step-down method (Scandinavian Journal of Statistics 6, 1979).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from statistics import fmean, stdev

import numpy as np

from aerodaas.schedulers.analytics.base import MIGRATED, STOLEN, Task, TaskOutcome, TaskPlace
from aerodaas.schedulers.analytics.windows import QoeWindows
from aerodaas.schedulers.lab.simulator import Trace

__all__ = [
    "SIGNIFICANT",
    "Comparison",
    "Mean",
    "Score",
    "compare",
    "holm",
    "mean_of",
    "permutation_p",
    "score",
    "seeds_needed",
]


@dataclass(slots=True)
class Score:
    """Sums over the tasks of one or more edges; add them up with `+`."""

    tasks: int = 0
    done: int = 0
    late: int = 0
    """Finished too late, timed out or failed."""
    dropped: int = 0
    """Never started, undecided ones included."""
    migrated: int = 0
    stolen: int = 0
    on_edge: int = 0
    """Executions begun on the edge."""
    in_cloud: int = 0
    qos: float = 0.0
    """Sum of the results' utilities."""
    qoe: float = 0.0
    """Bonuses of the windows that reached their share."""
    cost: float = 0.0
    edge_busy: int = 0
    """Nanoseconds of execution on the edge."""
    cloud_busy: int = 0
    undecided: int = 0
    done_by_model: dict[str, int] = field(default_factory=dict)
    tasks_by_model: dict[str, int] = field(default_factory=dict)

    def __add__(self, other: Score) -> Score:
        """Pool two scores."""
        total = Score()
        for item in fields(Score):
            mine, theirs = getattr(self, item.name), getattr(other, item.name)
            if isinstance(mine, dict):
                both = {key: mine.get(key, 0) + theirs.get(key, 0) for key in {**mine, **theirs}}
                setattr(total, item.name, both)
            else:
                setattr(total, item.name, mine + theirs)
        return total

    @property
    def completion(self) -> float:
        """Share of the tasks that finished in time, 0 to 1."""
        return self.done / self.tasks if self.tasks else 1.0


def score(tasks: Sequence[Task], trace: Trace) -> Score:
    """Judge one edge's run; a task counts in the QoE window in which it arrived.

    Args:
        tasks: All tasks that arrived at the edge.
        trace: The run's results and decisions.
    """
    total = Score(
        tasks=len(tasks),
        undecided=len(trace.undecided),
        migrated=trace.reasons[MIGRATED],
        stolen=trace.reasons[STOLEN],
        tasks_by_model=dict(Counter([task.profile.model for task in tasks])),
    )
    edge, cloud, in_time = TaskPlace.EDGE, TaskPlace.CLOUD, TaskOutcome.DONE
    on_edge = [result for result in trace.results if result.place is edge]
    in_cloud = [result for result in trace.results if result.place is cloud]
    done: Counter[str] = Counter()
    for ran in (on_edge, in_cloud):
        total.qos += sum([result.utility for result in ran])
        done.update([r.task.profile.model for r in ran if r.outcome is in_time])
    total.on_edge, total.in_cloud = len(on_edge), len(in_cloud)
    total.edge_busy = sum([result.finished - result.started for result in on_edge])
    total.cloud_busy = sum([result.finished - result.started for result in in_cloud])
    total.cost = sum([result.task.profile.edge_cost for result in on_edge])
    total.cost += sum([result.task.profile.cloud_cost for result in in_cloud])
    total.done_by_model = dict(done)
    total.done = sum(done.values())
    total.late = len(on_edge) + len(in_cloud) - total.done
    total.dropped = total.tasks - total.done - total.late
    total.qoe = _bonuses(tasks, trace)
    return total


def _bonuses(tasks: Sequence[Task], trace: Trace) -> float:
    windows = QoeWindows()
    in_time = TaskOutcome.DONE
    windows.arrived(*tasks)
    windows.done(*[result.task for result in trace.results if result.outcome is in_time])
    return windows.utility


@dataclass(frozen=True, slots=True)
class Mean:
    """A mean over seeds and the half width of its 95 % confidence interval (Student's t)."""

    value: float
    margin: float

    def __str__(self) -> str:
        """Mean and half width."""
        return f"{self.value:.4g} ± {self.margin:.2g}"


# Two-sided 95 % quantiles of Student's t for 1 to 30 degrees of freedom.
_T = (
    *(12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228),
    *(2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086),
    *(2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042),
)


def mean_of(values: Sequence[float]) -> Mean:
    """Mean and confidence interval; the interval of a single value is unknown (nan)."""
    if len(values) == 1:
        return Mean(values[0], math.nan)
    quantile = _T[len(values) - 2] if len(values) - 2 < len(_T) else 1.96
    return Mean(fmean(values), quantile * stdev(values) / math.sqrt(len(values)))


SIGNIFICANT = 0.05
"""Corrected p below which a difference is called significant."""

_EXACT = 14
"""Most seeds for which all of the 2^n signs are tried."""
_DRAWN = 20_000
"""Signs drawn beyond that: the least p is then 1 / 20001."""
_TOLERANCE = 1e-12
"""Relative; sums of the same numbers in another order may differ by rounding."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """A scheduler less the baseline, over the seeds that both saw."""

    difference: Mean
    """With the half width of its 95 % confidence interval."""
    p: float
    """Two-sided, not corrected; nan for a single seed."""


def compare(values: Sequence[float], baseline: Sequence[float]) -> Comparison:
    """Compare two schedulers' figures.

    Args:
        values: One for each seed.
        baseline: Of the same seeds, in the same order.
    """
    differences = [one - other for one, other in zip(values, baseline, strict=True)]
    return Comparison(mean_of(differences), permutation_p(differences))


def permutation_p(differences: Sequence[float]) -> float:
    """Two-sided p of a paired sign-flip permutation test of the mean.

    Exact for up to 14 differences, whose least p is 2 / 2^n; by 20 000 drawn signs, always the
    same, beyond. nan for a single one.
    """
    count = len(differences)
    if count < 2:  # noqa: PLR2004 - one seed tells nothing
        return math.nan
    values = np.array(differences, dtype=np.float64)
    if count <= _EXACT:
        flips = (np.arange(2**count)[:, None] >> np.arange(count)) & 1
    else:
        flips = np.random.default_rng(0).integers(0, 2, (_DRAWN, count))
    sums = np.abs((2 * flips - 1) @ values)
    as_far = int((sums >= abs(values.sum()) - _TOLERANCE * np.abs(values).sum()).sum())
    # What was observed counts among the drawn ones, so that p is never zero (Phipson, Smyth 2010).
    return as_far / len(flips) if count <= _EXACT else (as_far + 1) / (_DRAWN + 1)


def seeds_needed(comparisons: int) -> int:
    """Fewest seeds with which one of so many comparisons can be significant at all."""
    seeds = 2
    while seeds <= _EXACT and 2 / 2**seeds * comparisons >= SIGNIFICANT:
        seeds += 1
    return seeds


def holm(p_values: Sequence[float]) -> list[float]:
    """Correct p for the number of comparisons made; in the order given, nan left as it is."""
    known = [index for index, p in enumerate(p_values) if not math.isnan(p)]
    corrected = list(p_values)
    highest = 0.0
    for place, index in enumerate(sorted(known, key=lambda one: p_values[one])):
        highest = max(highest, min(1.0, (len(known) - place) * p_values[index]))
        corrected[index] = highest
    return corrected
