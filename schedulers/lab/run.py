"""Run schedulers over a workload, seed by seed, each on the very same sample paths."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

from aerodaas.schedulers.analytics.base import AnalyticsScheduler, Resources
from aerodaas.schedulers.analytics.registry import load_scheduler
from aerodaas.schedulers.lab.bound import clairvoyant_bound
from aerodaas.schedulers.lab.metrics import Mean, Score, mean_of, score
from aerodaas.schedulers.lab.network import Network
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import simulate
from aerodaas.schedulers.lab.times import ExecutionTimes
from aerodaas.schedulers.lab.workload import Workload
from aerodaas.types.errors import SchedulerError

__all__ = ["LabResult", "Spread", "Wanted", "run_lab", "scheduler_label"]

Wanted = str | type[AnalyticsScheduler] | AnalyticsScheduler
Spread = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""Something like `map`, such as `Pool.imap` of multiprocessing, or
`aerodaas.actors.cluster.ray_map.spread_over(address)` for a Ray cluster."""


@dataclass(frozen=True, slots=True)
class LabResult:
    """Scores by scheduler, one per seed, and the bound of each seed."""

    workload: Workload
    network: Network
    times: ExecutionTimes
    seeds: tuple[int, ...]
    scores: dict[str, list[Score]]
    bounds: list[float] | None

    def figures(self, scheduler: str) -> dict[str, Mean]:
        """Figures of a scheduler: means over the seeds with confidence intervals."""
        return {name: mean_of(values) for name, values in self.values(scheduler).items()}

    def values(self, scheduler: str) -> dict[str, list[float]]:
        """Figures of a scheduler, one for each seed.

        Rates are per second of the workload and summed over its edges; shares are 0 to 1.
        """
        seconds = self.workload.duration / 1e9
        busy = self.workload.duration * self.workload.edges
        scores = self.scores[scheduler]
        figures = {
            "completion": [s.completion for s in scores],
            "qos per s": [s.qos / seconds for s in scores],
            "qoe per s": [s.qoe / seconds for s in scores],
            "late": [s.late / max(s.tasks, 1) for s in scores],
            "dropped": [s.dropped / max(s.tasks, 1) for s in scores],
            "migrated": [s.migrated / max(s.tasks, 1) for s in scores],
            "stolen": [s.stolen / max(s.tasks, 1) for s in scores],
            "edge use": [s.edge_busy / busy for s in scores],
            "cloud use": [s.cloud_busy / busy for s in scores],
            "cost per s": [s.cost / seconds for s in scores],
        }
        if self.bounds is not None:
            figures["of bound"] = [
                s.qos / bound if bound else 1.0
                for s, bound in zip(scores, self.bounds, strict=True)
            ]
        return figures

    def as_json(self) -> dict[str, Any]:
        """Everything, for a file: means with half widths of 95 % intervals, and raw scores."""
        return {
            "workload": self.workload.name,
            "duration_s": self.workload.duration / 1e9,
            "drones": self.workload.drones,
            "edges": self.workload.edges,
            "network": self.network.name,
            "times": self.times.name,
            "seeds": list(self.seeds),
            "bounds": self.bounds,
            "schedulers": {
                name: {
                    "means": {key: asdict(mean) for key, mean in self.figures(name).items()},
                    "scores": [asdict(one) for one in self.scores[name]],
                }
                for name in self.scores
            },
        }


@dataclass(frozen=True, slots=True)
class _Study:
    workload: Workload
    schedulers: tuple[Wanted, ...]
    network: Network
    times: ExecutionTimes
    resources: Resources
    bound: bool


def run_lab(
    workload: Workload,
    schedulers: Sequence[Wanted],
    seeds: Sequence[int] = range(10),
    *,
    network: Network | None = None,
    times: ExecutionTimes | None = None,
    resources: Resources | None = None,
    bound: bool = True,
    jobs: int | None = None,
    spread: Spread | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> LabResult:
    """Simulate each scheduler on each seed's sample path.

    `jobs` processes share the work (by default one per core; 1 for none); `spread` takes their
    place, for example to use a Ray cluster. `progress` is told how many of how many parts are
    done. The same seeds give the same result, however the work is spread. Raises SchedulerError
    or UnknownIdError for a scheduler that cannot be loaded or that decides what cannot be done.
    """
    if not seeds or not schedulers:
        raise SchedulerError("a run of the lab needs at least one seed and one scheduler")
    names = [scheduler_label(one) for one in schedulers]
    if len(set(names)) < len(names):
        raise SchedulerError(f"schedulers must differ in name: {', '.join(names)}")
    for wanted in schedulers:
        load_scheduler(wanted)
    study = _Study(
        workload,
        tuple(schedulers),
        network or Network(),
        times or ExecutionTimes(),
        resources or Resources(),
        bound,
    )
    parts = [(seed, edge) for seed in seeds for edge in range(workload.edges)]
    scores = {name: [Score() for _ in seeds] for name in names}
    bounds = [0.0] * len(seeds)
    position = {seed: number for number, seed in enumerate(seeds)}
    with _spreader(spread, jobs, len(parts)) as apply:
        answers = apply(partial(_one_part, study), parts)
        for count, (seed, found, ceiling) in enumerate(answers, 1):
            number = position[seed]
            bounds[number] += ceiling
            for name, one in zip(names, found, strict=True):
                scores[name][number] += one
            if progress is not None:
                progress(count, len(parts))
    return LabResult(
        workload, study.network, study.times, tuple(seeds), scores, bounds if bound else None
    )


@contextmanager
def _uncollected() -> Iterator[None]:
    """Keep the garbage collector away from tasks and results, which live until the end anyway."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _one_part(study: _Study, part: tuple[int, int]) -> tuple[int, list[Score], float]:
    seed, edge = part
    with _uncollected():
        path = SamplePath.draw(study.workload, edge, seed, study.times, study.network)
        scores = [
            score(path.tasks, simulate(path, load_scheduler(wanted), study.resources))
            for wanted in study.schedulers
        ]
    return seed, scores, clairvoyant_bound(path) if study.bound else 0.0


def scheduler_label(wanted: Wanted) -> str:
    """The name by which results are told: the one given, or the class'."""
    if isinstance(wanted, str):
        return wanted
    return wanted.__name__ if isinstance(wanted, type) else type(wanted).__name__


class _spreader:  # noqa: N801 - a context manager, used as a function
    """Gives something like `map`, and stops its processes afterwards."""

    def __init__(self, spread: Spread | None, jobs: int | None, parts: int) -> None:
        workers = min(jobs or os.cpu_count() or 1, parts)
        self._pool = ProcessPoolExecutor(workers) if spread is None and workers > 1 else None
        self._spread = spread
        self._chunk = max(1, parts // (8 * workers))

    def __enter__(self) -> Spread:
        if self._pool is not None:
            return partial(self._pool.map, chunksize=self._chunk)
        return self._spread or map

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
