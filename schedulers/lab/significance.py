"""Whether one scheduler is better than another: paired over the seeds, as both saw the same paths.

Intervals are Student's t over the differences. Tests are sign-flip permutation tests for paired
samples (Fisher 1935, Pitman 1937), which assume no distribution: were the two schedulers alike,
each seed's difference could as well have the other sign. Several comparisons are corrected by
Holm's step-down method (Scandinavian Journal of Statistics 6, 1979).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerodaas.schedulers.lab.metrics import Mean, mean_of

__all__ = ["SIGNIFICANT", "Comparison", "compare", "holm", "permutation_p", "seeds_needed"]

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
