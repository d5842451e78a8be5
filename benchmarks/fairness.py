"""Two tenants on one edge and its cloud: what each gets under plain DEMS, and when it is shared.

python benchmarks/fairness.py --json fairness.json
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer
from _report import Report
from rich.progress import track

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import Resources
from aerodaas.schedulers.analytics.published.profiles import ACTIVE, PASSIVE, PUBLISHED
from aerodaas.schedulers.lab import LabResult, Workload, run_lab
from aerodaas.schedulers.lab.workload import TaskArrival

UNITS = {
    "first": "%",
    "second": "%",
    "first work": "%",
    "second work": "%",
    "edge use": "%",
    "QoS": "per s",
}
"""Tasks in time over tasks; and work done: their times on the edge over the duration, wherever they
ran."""


@dataclass(frozen=True)
class Demand:
    """What one tenant asks for."""

    drones: int
    models: tuple[str, ...]
    weight: float = 1.0


@dataclass(frozen=True)
class Case:
    """Two tenants, and the cloud's slots."""

    first: Demand
    second: Demand
    slots: int


LITTLE, MUCH = Demand(1, ("HV", "DEV")), Demand(8, ACTIVE)
CASES = {
    "modest, greedy; 32 slots": Case(LITTLE, MUCH, 32),
    "modest, greedy; 4 slots": Case(LITTLE, MUCH, 4),
    "modest, greedy; no cloud": Case(LITTLE, MUCH, 0),
    "greedy, greedy; 4 slots": Case(Demand(6, PASSIVE), Demand(6, PASSIVE), 4),
    "greedy, greedy 3:1; 4 slots": Case(Demand(6, PASSIVE, 3.0), Demand(6, PASSIVE), 4),
    "greedy, greedy 3:1; no cloud": Case(Demand(6, PASSIVE, 3.0), Demand(6, PASSIVE), 0),
}


def main(
    scheduler: Annotated[str, typer.Option(help="Comma-separated.")] = "dems,sfq_dems",
    seeds: Annotated[int, typer.Option(min=1)] = 5,
    duration: Annotated[int, typer.Option(help="Simulated seconds per seed.", min=1)] = 100,
    json: Annotated[Path | None, typer.Option(help="File for the figures.")] = None,
) -> None:
    """Each tenant's tasks in time, its work done, and what sharing costs in utility."""
    report = Report("fairness", UNITS, packages=["aerodaas"])
    names = scheduler.split(",")
    for title, case in track(CASES.items(), "simulating", transient=True):
        for name in names:
            results = [
                run_lab(
                    workload(case, duration, seed),
                    [name],
                    [seed],
                    resources=Resources(cloud_slots=case.slots),
                    bound=False,
                    jobs=1,
                )
                for seed in range(seeds)
            ]
            report.row(f"{title}: {name}", figures(results, name, duration))
    report.note(f"{seeds} seeds of {duration} s; six published models; weights 1:1 but where told")
    report.show()
    if json is not None:
        report.write(json)


def workload(case: Case, duration: int, seed: int) -> Workload:
    """Tasks of both tenants, each drone with a phase of its own."""
    draw = random.Random(f"{seed}/phases")
    tenants: Mapping[str, Demand] = {"first": case.first, "second": case.second}
    models = {
        f"{tenant}.{model}": replace(
            PUBLISHED[model], model=f"{tenant}.{model}", tenant=tenant, weight=demand.weight
        )
        for tenant, demand in tenants.items()
        for model in demand.models
    }
    arrivals: list[TaskArrival] = []
    for tenant, demand in tenants.items():
        for drone in range(demand.drones):
            phase = draw.randrange(NANOSECONDS)
            for second in range(duration):
                for model in draw.sample(demand.models, len(demand.models)):
                    at, name = second * NANOSECONDS + phase, f"{tenant}.{model}"
                    arrivals.append(TaskArrival(at, name, f"{tenant}{drone}"))
    lasting = duration * NANOSECONDS
    return Workload("two tenants", models, duration=lasting, arrivals=tuple(arrivals))


def figures(results: list[LabResult], name: str, duration: int) -> dict[str, float]:
    """Means over the seeds, by tenant."""
    found = dict.fromkeys(UNITS, 0.0)
    for result in results:
        (score,) = result.scores[name]
        for tenant in ("first", "second"):
            own = [model for model in score.tasks_by_model if model.startswith(f"{tenant}.")]
            done = {model: score.done_by_model.get(model, 0) for model in own}
            times = {model: result.workload.models[model].edge_time for model in own}
            asked = sum(score.tasks_by_model[model] for model in own)
            worth = sum(count * times[model] for model, count in done.items())
            found[tenant] += 100 * sum(done.values()) / asked
            found[f"{tenant} work"] += 100 * worth / (duration * NANOSECONDS)
        found["edge use"] += 100 * score.edge_busy / (duration * NANOSECONDS)
        found["QoS"] += score.qos / duration
    return {key: value / len(results) for key, value in found.items()}


if __name__ == "__main__":
    typer.run(main)
