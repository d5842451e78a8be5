"""Run schedulers over a workload, seed by seed, each on the very same sample paths."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from typing import Any

from aerodaas.errors import SchedulerError, failure_line
from aerodaas.schedulers.analytics.base import AnalyticsScheduler, Resources
from aerodaas.schedulers.analytics.registry import load_scheduler
from aerodaas.schedulers.lab.bound import clairvoyant_bound
from aerodaas.schedulers.lab.metrics import Mean, Score, mean_of, score
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.sample import SamplePath
from aerodaas.schedulers.lab.simulator import Trace, simulate
from aerodaas.schedulers.lab.workload import Workload

__all__ = [
    "LabResult",
    "Spread",
    "Wanted",
    "batch_size",
    "over_processes",
    "run_lab",
    "scheduler_label",
]

Spread = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]
"""An ordered `map`, such as `Pool.imap` of multiprocessing."""

_BATCHES = 16
"""Batches for each worker: enough that all end at about the same time."""


def batch_size(parts: int, workers: int) -> int:
    """How many of the parts go to a worker at once, so that few messages are sent.

    Args:
        parts: How many parts there are.
        workers: How many workers share them.
    """
    return max(1, parts // (_BATCHES * workers))


@contextmanager
def over_processes(jobs: int | None, parts: int | None = None) -> Iterator[Spread]:
    """Give a map over processes, which end with the context.

    Args:
        jobs: Processes; None for one for each core, 1 for the ordinary `map`.
        parts: Parts of the work, where their number is known; no more processes are used.
    """
    workers = jobs or os.cpu_count() or 1
    if parts is not None:
        workers = min(workers, parts)
    if workers == 1:
        yield map
        return
    pool = ProcessPoolExecutor(workers)

    def spread(function: Callable[[Any], Any], parts: Sequence[Any]) -> Iterable[Any]:
        return pool.map(function, parts, chunksize=batch_size(len(parts), workers))

    try:
        yield spread
    finally:
        pool.shutdown(cancel_futures=True)


Wanted = str | type[AnalyticsScheduler] | AnalyticsScheduler

_RATE = " per s"
"""What the names of rates end with, which are sums over the edges."""


@dataclass(frozen=True, slots=True)
class LabResult:
    """Scores by scheduler, one per seed, and the bound of each seed."""

    workload: Workload
    network: Network
    times: ExecutionTimes
    seeds: tuple[int, ...]
    scores: dict[str, list[Score]]
    bounds: list[float] | None
    edges: dict[str, list[Score]]
    """Scores of each edge where there is a single seed; else nothing."""

    def figures(self, scheduler: str) -> dict[str, Mean]:
        """Figures of a scheduler: means over the seeds with confidence intervals.

        With a single seed, the intervals are those over its edges, each of which draws its own
        arrivals and times.
        """
        means = {name: mean_of(values) for name, values in self.values(scheduler).items()}
        edges = self.edges.get(scheduler, [])
        if len(edges) > 1:
            for name, values in self._values(edges, self.workload.duration).items():
                margin = mean_of(values).margin
                total = len(edges) if name.endswith(_RATE) else 1
                means[name] = Mean(means[name].value, margin * total)
        return means

    def values(self, scheduler: str) -> dict[str, list[float]]:
        """Figures of a scheduler, one for each seed.

        Rates are per second of the workload and summed over its edges; shares are 0 to 1.
        """
        scores = self.scores[scheduler]
        figures = self._values(scores, self.workload.duration * self.workload.edges)
        if self.bounds is not None:
            figures["of bound"] = [
                s.qos / bound if bound else 1.0
                for s, bound in zip(scores, self.bounds, strict=True)
            ]
        return figures

    def _values(self, scores: Sequence[Score], busy: int) -> dict[str, list[float]]:
        """Figures of some scores; `busy` is how long their executors could be, nanoseconds."""
        seconds = self.workload.duration / 1e9
        return {
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

    The same seeds give the same result, however the work is spread.

    Args:
        workload: The drones and their tasks.
        schedulers: Schedulers or their names, which must differ.
        seeds: Seeds of the sample paths.
        network: Of the path to the cloud; steady by default.
        times: Distribution of execution times; the expected ones by default.
        resources: The edge executor and the cloud; by default those of the class.
        bound: Whether to compute the clairvoyant bound of each path.
        jobs: Processes that share the work; None for one per core, 1 for none.
        spread: A map in their place.
        progress: Called with the number of parts done and of all parts.

    Raises:
        SchedulerError: If there is no seed or scheduler, or a scheduler cannot be loaded, raises or
            decides what cannot be done; the latter two with the seed and the edge.
        UnknownIdError: If there is no scheduler of a name.
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
    edges: dict[str, list[Score]] = {name: [] for name in names} if len(seeds) == 1 else {}
    bounds = [0.0] * len(seeds)
    position = {seed: number for number, seed in enumerate(seeds)}
    with nullcontext(spread) if spread else over_processes(jobs, len(parts)) as apply:
        answers = apply(partial(_one_part, study), parts)
        for count, (seed, found, ceiling) in enumerate(answers, 1):
            number = position[seed]
            bounds[number] += ceiling
            for name, one in zip(names, found, strict=True):
                scores[name][number] += one
                if edges:
                    edges[name].append(one)
            if progress is not None:
                progress(count, len(parts))
    return LabResult(
        *(workload, study.network, study.times, tuple(seeds), scores),
        bounds=bounds if bound else None,
        edges=edges,
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
            score(path.tasks, _simulated(path, wanted, study.resources, seed, edge))
            for wanted in study.schedulers
        ]
    return seed, scores, clairvoyant_bound(path) if study.bound else 0.0


def _simulated(
    path: SamplePath, wanted: Wanted, resources: Resources, seed: int, edge: int
) -> Trace:
    try:
        return simulate(path, load_scheduler(wanted), resources)
    except Exception as error:
        # As text, for an exception of a class that only one process knows does not travel.
        what = str(error) if isinstance(error, SchedulerError) else failure_line(error)
        where = f"{scheduler_label(wanted)} with seed {seed} on edge {edge}"
        raise SchedulerError(f"{where}: {what}") from error


def scheduler_label(wanted: Wanted) -> str:
    """The name by which results are told: the one given, or the class'."""
    if isinstance(wanted, str):
        return wanted
    return wanted.__name__ if isinstance(wanted, type) else type(wanted).__name__
