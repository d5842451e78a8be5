"""The leaderboard: schedulers on one fixed set of cases with the same seeds, ranked.

Each case is a workload on a network with its execution times and cloud slots. On each seed's
sample path a scheduler's utility is divided by the clairvoyant bound; its figure for a seed is the
mean over the cases, so that each case counts alike, whatever its tasks are worth. Standings are
means over the seeds with 95 % intervals (Student's t), and differences from the leader are tested
seed by seed (`aerodaas.schedulers.lab.metrics`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import Resources
from aerodaas.schedulers.lab.metrics import SIGNIFICANT, Mean, compare, holm, mean_of
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.run import LabResult, Wanted, run_lab, scheduler_label
from aerodaas.schedulers.lab.workload import Workload

__all__ = ["CASES", "FULL", "QUICK", "SET", "Case", "Extent", "Leaderboard", "run_leaderboard"]

SET = 1
"""Version of the set of cases; standings of different versions are not comparable."""


@dataclass(frozen=True, slots=True)
class Case:
    """One case of the set, in the words of `aerodaas lab run`."""

    name: str
    about: str
    workload: str
    network: str = "steady"
    times: str = "nominal"
    cloud_slots: int = Resources().cloud_slots


_PUBLISHED_TIMES = "lognormal:0.15@0.95"
"""The table's times as 95th percentiles, as published ones often are: few take longer."""

CASES = (
    Case("light", "Two drones, four models: the edge nearly holds them.", "2D-P"),
    Case(
        "usual",
        "Three drones, six models; executions vary by 15 %, and few take longer than the table "
        "says.",
        "3D-A",
        times=_PUBLISHED_TIMES,
    ),
    Case(
        "crowded",
        "Four drones, six models: most has to go to the cloud, or be left.",
        "4D-A",
        times=_PUBLISHED_TIMES,
    ),
    Case(
        "slow network",
        "The link's latency rises by 400 ms, stays, and falls again.",
        "3D-A",
        network="trapezium",
        times=_PUBLISHED_TIMES,
    ),
    Case(
        "outages",
        "No link to the cloud for a tenth of the time, and later for a twentieth.",
        "3D-A",
        network="outage",
        times=_PUBLISHED_TIMES,
    ),
    Case(
        "few slots",
        "The cloud runs four tasks at once, which the bound does not count.",
        "4D-P",
        times=_PUBLISHED_TIMES,
        cloud_slots=4,
    ),
    Case(
        "erratic",
        "Executions vary by 50 %, and the table is their mean: no estimate holds for long.",
        "3D-P",
        times="gamma:0.5",
    ),
    Case(
        "all at once",
        "Four drones, a slow network with outages, executions that vary by 30 %.",
        "4D-A",
        network="trapezium+outage",
        times="lognormal:0.3",
    ),
)
"""The set. Whoever changes it raises `SET`."""


@dataclass(frozen=True, slots=True)
class Extent:
    """How much of each case is simulated."""

    seeds: int
    seconds: int


QUICK = Extent(seeds=10, seconds=60)
FULL = Extent(seeds=30, seconds=300)


@dataclass(frozen=True, slots=True)
class Rank:
    """A scheduler's place, with the shares that earned it (0 to 1)."""

    rank: int
    """By utility; schedulers of the same utility share one."""
    scheduler: str
    utility: Mean
    """Of the clairvoyant bound, mean over cases and seeds."""
    completion: Mean
    """Tasks in time, of all tasks that came."""
    completion_rank: int
    p: float
    """That it is as good as the leader, by utility, corrected by Holm; nan for the leader."""
    cases: dict[str, tuple[Mean, Mean]]
    """Utility and completion in each case."""

    @property
    def is_behind(self) -> bool:
        """Whether its utility is significantly below the leader's."""
        return self.p < SIGNIFICANT


@dataclass(frozen=True, slots=True)
class Leaderboard:
    """Standings, best utility first, and what they rest on."""

    extent: Extent
    standings: tuple[Rank, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Tidy: a row for each scheduler and case, and one (`case` is `all`) for its standing."""
        return [
            {
                "set": SET,
                "rank": one.rank,
                "scheduler": one.scheduler,
                "case": case,
                "utility_of_bound": utility.value,
                "utility_margin": utility.margin,
                "completion": completion.value,
                "completion_margin": completion.margin,
            }
            for one in self.standings
            for case, (utility, completion) in {
                "all": (one.utility, one.completion),
                **one.cases,
            }.items()
        ]


def run_leaderboard(
    schedulers: Sequence[Wanted],
    *,
    extent: Extent = QUICK,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Leaderboard:
    """Simulate schedulers in all cases and rank them.

    Args:
        schedulers: Names, `module:Class`, `file.py:Class`, classes or instances.
        extent: Seeds, 0 to N-1, and simulated seconds of each case.
        jobs: Processes, by default one per core.
        progress: Told how many of how many sample paths are done.

    Raises:
        SchedulerError: As `run_lab`, or for fewer than two seeds, which have no interval.
        UnknownIdError: For a scheduler that there is not.
    """
    if extent.seeds < 2:  # noqa: PLR2004 - one seed tells nothing
        raise SchedulerError("a leaderboard needs at least two seeds")
    before = 0

    def advance(done: int, _: int) -> None:
        if progress is not None:
            progress(before + done, len(CASES) * extent.seeds)

    results: dict[str, LabResult] = {}
    for case in CASES:
        load = Workload.named(case.workload, extent.seconds * NANOSECONDS)
        results[case.name] = run_lab(
            load,
            schedulers,
            range(extent.seeds),
            network=Network.named(case.network, load.duration),
            times=ExecutionTimes.named(case.times),
            resources=Resources(cloud_slots=case.cloud_slots),
            jobs=jobs,
            progress=advance,
        )
        before += extent.seeds
    return Leaderboard(extent, _standings([scheduler_label(one) for one in schedulers], results))


def _standings(names: Sequence[str], results: dict[str, LabResult]) -> tuple[Rank, ...]:
    values = {name: [one.values(name) for one in results.values()] for name in names}
    utility = {name: _over_cases(values[name], "of bound") for name in names}
    completion = {name: _over_cases(values[name], "completion") for name in names}
    order = sorted(names, key=lambda name: (-round(fmean(utility[name]), 9), name))
    leader = order[0]
    p_values = [
        # One that does exactly as the leader does is not behind it.
        1.0 if utility[name] == utility[leader] else compare(utility[name], utility[leader]).p
        for name in order[1:]
    ]
    corrected = dict(zip(order[1:], holm(p_values), strict=True))
    return tuple(
        Rank(
            _rank(utility, name),
            name,
            mean_of(utility[name]),
            mean_of(completion[name]),
            _rank(completion, name),
            corrected.get(name, math.nan),
            {
                case: (mean_of(found["of bound"]), mean_of(found["completion"]))
                for case, found in zip(results, values[name], strict=True)
            },
        )
        for name in order
    )


def _over_cases(cases: Sequence[dict[str, list[float]]], figure: str) -> list[float]:
    """The mean over the cases, for each seed."""
    return [fmean(of_seed) for of_seed in zip(*(case[figure] for case in cases), strict=True)]


def _rank(figures: dict[str, list[float]], name: str) -> int:
    """One more than how many are better, to nine digits."""
    own = round(fmean(figures[name]), 9)
    return 1 + sum(round(fmean(values), 9) > own for values in figures.values())
