"""How fast the lab simulates, from one edge to a thousand.

python benchmarks/lab.py --json lab.json
"""

from __future__ import annotations

import time
from math import inf
from pathlib import Path
from typing import Annotated

import typer
from _report import Report
from rich.progress import track

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.registry import scheduler_names
from aerodaas.schedulers.lab import Workload, run_lab

UNITS = {"time": "s", "CPU": "s", "tasks": "k", "rate": "k tasks/s", "per task": "us"}


def main(
    scheduler: Annotated[str, typer.Option(help="Comma-separated; or all.")] = "ec_edf,dems,margin",
    edges: Annotated[
        str, typer.Option(help="Comma-separated, or none: ''; 3 drones each.")
    ] = "1,10,100,1000",
    duration: Annotated[float, typer.Option(help="Simulated seconds of the growing fleet.")] = 30,
    jobs: Annotated[int, typer.Option(help="Processes.", min=1)] = 1,
    rounds: Annotated[
        int, typer.Option(help="Of each the least time and CPU are told.", min=1)
    ] = 1,
    json: Annotated[Path | None, typer.Option(help="File for the figures.")] = None,
) -> None:
    """Simulated tasks per second: 80 drones with 6 models for 300 s, and a growing fleet."""
    report = Report("lab", UNITS)
    loads = {"80D-A/7 300 s": Workload.named("80D-A/7")}
    for count in filter(None, edges.split(",")):
        name = f"{3 * int(count)}D-A/{count}"
        loads[f"{name} {duration:g} s"] = Workload.named(name, round(duration * NANOSECONDS))
    per_task: dict[str, list[tuple[int, float]]] = {}
    names = scheduler_names() if scheduler == "all" else scheduler.split(",")
    cases = [(case, name) for name in names for case in loads]
    for case, name in track(cases, "simulating", transient=True):
        taken, cpu, tasks = inf, inf, 0
        for _ in range(rounds):
            began, worked = time.perf_counter(), time.process_time()
            result = run_lab(loads[case], [name], [0], bound=False, jobs=jobs)
            taken = min(taken, time.perf_counter() - began)
            cpu = min(cpu, time.process_time() - worked)
            tasks = result.scores[name][0].tasks
        figures = (taken, cpu, tasks / 1e3, tasks / 1e3 / taken, taken / tasks * 1e6)
        report.row(f"{name} {case}", dict(zip(UNITS, figures, strict=True)))
        alone = jobs == 1
        # Other work on the machine prolongs the wall time, but hardly the processor's.
        per_task.setdefault(name, []).append((loads[case].edges, (cpu if alone else taken) / tasks))
    for name, (_, *grown) in per_task.items():
        if not grown:
            continue
        (least, first), (most, last) = grown[0], grown[-1]
        report.note(
            f"{name}: from {least} to {most} edges the time per task grows {last / first:.2f} times"
            " (1 is linear growth)"
        )
    report.note(f"{jobs} process(es), without the clairvoyant bound; CPU is of the first process")
    report.show()
    if json is not None:
        report.write(json)


if __name__ == "__main__":
    typer.run(main)
