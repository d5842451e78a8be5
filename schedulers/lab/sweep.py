"""Sweeps: every combination of some parameters, with the same seeds, as one tidy table."""

from __future__ import annotations

import inspect
import itertools
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Any

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError, UnknownIdError
from aerodaas.schedulers.analytics.base import AnalyticsScheduler, Resources
from aerodaas.schedulers.analytics.published.profiles import ACTIVE, PASSIVE, PUBLISHED
from aerodaas.schedulers.analytics.registry import load_scheduler
from aerodaas.schedulers.lab.metrics import SIGNIFICANT, Comparison, compare, holm, mean_of
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.run import (
    LabResult,
    Spread,
    Wanted,
    over_processes,
    run_lab,
    scheduler_label,
)
from aerodaas.schedulers.lab.workload import Workload

__all__ = ["PARAMETERS", "SweepResult", "run_sweep"]

PARAMETERS: dict[str, type] = {
    "drones": int,
    "edges": int,
    "models": str,
    "network": str,
    "times": str,
    "cloud_slots": int,
    "duration": float,
}
"""What can be swept, and its type: `models` is A (all six) or P (four) of the published ones,
`duration` seconds; the others as in `aerodaas lab run`. Beside them, `scheduler.KEYWORD` of a
constructor."""
_OWN = "scheduler."
_MODELS = {"A": ACTIVE, "P": PASSIVE}

Row = dict[str, Any]


@dataclass(frozen=True)
class SweepResult:
    """Results of all cases."""

    parameters: tuple[str, ...]
    """Those that were swept."""
    schedulers: tuple[str, ...]
    baseline: str
    seeds: tuple[int, ...]
    cases: tuple[tuple[Row, LabResult], ...]
    """The parameters of each case, and what came out."""

    @property
    def rows(self) -> list[Row]:
        """One row for each case, scheduler and seed: the parameters, then the figures.

        Rates are per second and summed over the edges; shares are 0 to 1.
        `pandas.DataFrame(result.rows)` takes them as they are.
        """
        return [
            {**case, "scheduler": name, "seed": seed, **_figures_of(values, place)}
            for case, result in self.cases
            for name, values in self._values(result).items()
            for place, seed in enumerate(self.seeds)
        ]

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures."""
        return tuple(next(iter(self._values(self.cases[0][1]).values())))

    def summary(self, figure: str) -> list[Row]:
        """Means of a figure with 95 % intervals, and their differences from the baseline.

        One row for each case and scheduler: `mean`, `low`, `high`; `difference`,
        `difference_low`, `difference_high` paired over the seeds; `p` of a paired sign-flip
        permutation test, `p_holm` corrected for all comparisons of this figure in the sweep, and
        whether that is `significant` (below 0.05). The baseline's own rows compare nothing.

        Raises:
            UnknownIdError: For a figure that there is not.
        """
        if figure not in self.figures:
            raise UnknownIdError("figure", figure, list(self.figures))
        rows: list[Row] = []
        compared: list[Comparison] = []
        for case, result in self.cases:
            values = self._values(result)
            for name in self.schedulers:
                mean = mean_of(values[name][figure])
                spread = {"low": mean.value - mean.margin, "high": mean.value + mean.margin}
                row = {**case, "scheduler": name, "figure": figure, "seeds": len(self.seeds)}
                rows.append({**row, "mean": mean.value, **spread})
                if name != self.baseline:
                    compared.append(compare(values[name][figure], values[self.baseline][figure]))
        corrected = iter(holm([one.p for one in compared]))
        waiting = iter(compared)
        for row in rows:
            if row["scheduler"] == self.baseline:
                row.update(dict.fromkeys(_COMPARED))
                continue
            one, p = next(waiting), next(corrected)
            value, margin = one.difference.value, one.difference.margin
            found = (value, value - margin, value + margin, one.p, p, p < SIGNIFICANT)
            row.update(zip(_COMPARED, found, strict=True))
        return rows

    def _values(self, result: LabResult) -> dict[str, dict[str, list[float]]]:
        """Figures by scheduler, one for each seed."""
        return {
            name: result.values(inner)
            for name, inner in zip(self.schedulers, result.scores, strict=True)
        }


_COMPARED = ("difference", "difference_low", "difference_high", "p", "p_holm", "significant")


def run_sweep(
    schedulers: Sequence[Wanted],
    parameters: Mapping[str, Sequence[Any]],
    *,
    workload: Workload | str = "3D-A",
    seeds: Sequence[int] = range(20),
    baseline: str | None = None,
    network: str = "steady",
    times: str = "nominal",
    cloud_slots: int | None = None,
    duration: float | None = None,
    bound: bool = False,
    jobs: int | None = None,
    spread: Spread | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> SweepResult:
    """Simulate schedulers in every combination of `parameters`, each with the same seeds.

    Args:
        schedulers: As for `run_lab`.
        parameters: Values by name, of `PARAMETERS`, or of `scheduler.KEYWORD`, which goes to the
            constructors that have it.
        workload: What is not swept, or its name.
        seeds: Numbers that arrivals, times of execution and networks are drawn by.
        baseline: Name of the scheduler with which the others are compared; the first by default.
        network: Where it is not swept, as by `Network.named`.
        times: Likewise, as by `ExecutionTimes.named`.
        cloud_slots: Executions in the cloud at once; None: 32.
        duration: Seconds; None: the workload's.
        bound: Compute the clairvoyant bound, too, which takes longer than simulating.
        jobs: Processes that share seeds and edges; None: one per core.
        spread: A map in their place.
        progress: Told how many of how many parts are done, one for each case, seed and edge.

    Raises:
        SchedulerError: For parameters that cannot be, or schedulers that cannot be loaded.
        UnknownIdError: For a name that is none.
    """
    labels = tuple(scheduler_label(one) for one in schedulers)
    if not labels or not seeds:
        raise SchedulerError("a sweep needs at least one scheduler and one seed")
    baseline = labels[0] if baseline is None else baseline
    if baseline not in labels:
        raise UnknownIdError("scheduler of this sweep", baseline, list(labels))
    _check(parameters, schedulers)
    base = Workload.named(workload) if isinstance(workload, str) else workload
    fixed: Row = {"network": network, "times": times}
    fixed.update({"cloud_slots": cloud_slots} if cloud_slots is not None else {})
    fixed.update({"duration": duration} if duration is not None else {})
    combinations = [
        dict(zip(parameters, values, strict=True))
        for values in itertools.product(*parameters.values())
    ]
    # What cannot be shall be told before the first case is simulated.
    prepared = [_prepared(base, {**fixed, **case}) for case in combinations]
    cases: list[tuple[Row, LabResult]] = []
    total = len(seeds) * sum(load.edges for load, *_ in prepared)
    before = 0

    def advance(done: int, _: int) -> None:
        if progress is not None:
            progress(before + done, total)

    # One set of processes for all cases, which take a moment to start.
    with nullcontext(spread) if spread else over_processes(jobs) as share:
        for case, (load, link, drawn, slots) in zip(combinations, prepared, strict=True):
            result = run_lab(
                load,
                [_built(one, case) for one in schedulers],
                seeds,
                network=link,
                times=drawn,
                resources=slots,
                bound=bound,
                spread=share,
                progress=advance,
            )
            cases.append((case, result))
            before += len(seeds) * load.edges
    return SweepResult(tuple(parameters), labels, baseline, tuple(seeds), tuple(cases))


def _check(parameters: Mapping[str, Sequence[Any]], schedulers: Sequence[Wanted]) -> None:
    if not parameters:
        raise SchedulerError("a sweep needs a parameter with its values, such as drones=2,4,8")
    for name, values in parameters.items():
        if not values or len(set(values)) < len(values):
            raise SchedulerError(f"the sweep of {name} needs values, each once")
        keyword = name.removeprefix(_OWN)
        if keyword == name and name not in PARAMETERS:
            raise UnknownIdError("parameter", name, [*PARAMETERS, f"{_OWN}KEYWORD"])
        if keyword != name and not any(_takes(one, keyword) for one in schedulers):
            raise SchedulerError(f"no scheduler of the sweep is built with {keyword!r}")


def _prepared(
    base: Workload, case: Mapping[str, Any]
) -> tuple[Workload, Network, ExecutionTimes, Resources]:
    """Arguments of `run_lab` for one case."""
    changes: Row = {name: case[name] for name in ("drones", "edges") if name in case}
    if base.is_listed and (changes or "models" in case):
        raise SchedulerError(f"{base.name} lists its tasks: drones, edges and models are its own")
    if "models" in case:
        if case["models"] not in _MODELS:
            raise UnknownIdError("set of models", str(case["models"]), list(_MODELS))
        changes["models"] = {name: PUBLISHED[name] for name in _MODELS[case["models"]]}
    if "duration" in case:
        changes["duration"] = round(case["duration"] * NANOSECONDS)
    load = replace(base, **changes)
    slots = Resources() if "cloud_slots" not in case else Resources(cloud_slots=case["cloud_slots"])
    return (
        load,
        Network.named(case["network"], load.duration),
        ExecutionTimes.named(case["times"]),
        slots,
    )


def _takes(wanted: Wanted, keyword: str) -> bool:
    """Whether a scheduler's constructor has a keyword; a published variant is what it is."""
    if isinstance(wanted, AnalyticsScheduler) or str(wanted).endswith("_published"):
        return False
    return keyword in inspect.signature(type(load_scheduler(wanted))).parameters


def _built(wanted: Wanted, case: Mapping[str, Any]) -> Wanted:
    """A scheduler with the keywords of this case that it takes."""
    own = {name.removeprefix(_OWN): value for name, value in case.items() if name.startswith(_OWN)}
    taken = {name: value for name, value in own.items() if _takes(wanted, name)}
    if not taken:
        return wanted
    try:
        return type(load_scheduler(wanted))(**taken)
    except (TypeError, ValueError) as error:
        raise SchedulerError(f"{wanted!r} cannot be built with {taken}: {error}") from error


def _figures_of(values: Mapping[str, Sequence[float]], place: int) -> Row:
    return {name: series[place] for name, series in values.items()}
