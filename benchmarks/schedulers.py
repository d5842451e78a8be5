"""Every analytics scheduler on every published workload, at nominal times and under variation.

python benchmarks/schedulers.py --seeds 10 --json schedulers.json
"""

from __future__ import annotations

from pathlib import Path
from statistics import fmean
from typing import Annotated

import typer
from _report import Report
from rich.progress import track

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.registry import scheduler_names
from aerodaas.schedulers.lab import ExecutionTimes, LabResult, Network, Workload, run_lab
from aerodaas.schedulers.lab.workload import SIX

CASES = {
    "nominal": ("nominal", "steady"),
    "cv15": ("lognormal:0.15", "steady"),
    "trapezium": ("nominal", "trapezium"),
    "outage": ("nominal", "outage"),
}
UNITS = {
    "QoS": "per s",
    "± 95 %": "per s",
    "of bound": "%",
    "completion": "%",
    "QoE": "per s",
    "± QoE": "per s",
    "late": "%",
    "dropped": "%",
    "cost": "per s",
}


def main(
    scheduler: Annotated[str, typer.Option(help="Comma-separated; default all.")] = "",
    workload: Annotated[str, typer.Option(help="Comma-separated.")] = ",".join(SIX),
    case: Annotated[str, typer.Option(help="Comma-separated.")] = ",".join(CASES),
    seeds: Annotated[int, typer.Option(min=1)] = 5,
    duration: Annotated[float, typer.Option(help="Simulated seconds per seed.")] = 100.0,
    json: Annotated[Path | None, typer.Option(help="File for the figures.")] = None,
) -> None:
    """Completion, utility as a share of the clairvoyant bound, and QoE, with our own aims."""
    names = scheduler.split(",") if scheduler else scheduler_names()
    report = Report("schedulers", UNITS, packages=["aerodaas"])
    results: dict[tuple[str, str], LabResult] = {}
    jobs = [(load, kind) for load in workload.split(",") for kind in case.split(",")]
    for load, kind in track(jobs, "simulating", transient=True):
        times, network = CASES[kind]
        made = Workload.named(load, round(duration * NANOSECONDS))
        results[load, kind] = run_lab(
            made,
            names,
            range(seeds),
            times=ExecutionTimes.named(times),
            network=Network.named(network, made.duration),
        )
        for name in names:
            report.row(f"{load} {kind} {name}", _figures(results[load, kind], name))
    report.note(f"{seeds} seeds of {duration:g} s each; cv15: lognormal around the table's means")
    for aim in _aims(results, set(names)):
        report.note(aim)
    report.show()
    if json is not None:
        report.write(json)


def _figures(result: LabResult, name: str) -> dict[str, float]:
    found = result.figures(name)
    return {
        "QoS": found["qos per s"].value,
        "± 95 %": found["qos per s"].margin,
        "of bound": 100 * found["of bound"].value,
        "completion": 100 * found["completion"].value,
        "QoE": found["qoe per s"].value,
        "± QoE": found["qoe per s"].margin,
        "late": 100 * found["late"].value,
        "dropped": 100 * found["dropped"].value,
        "cost": found["cost per s"].value,
    }


def _aims(results: dict[tuple[str, str], LabResult], names: set[str]) -> list[str]:
    """How far ours is from what we set out to reach."""
    if not {"margin", "dems", "dems_a", "gems"} <= names:
        return []
    notes = []
    for kind in dict.fromkeys(kind for _, kind in results):
        loads = [result for (_, of), result in results.items() if of == kind]
        share = fmean(100 * one.figures("margin")["of bound"].value for one in loads)
        least = min(_ratio(one) for one in loads)
        qoe = min(
            one.figures("margin")["qoe per s"].value - one.figures("gems")["qoe per s"].value
            for one in loads
        )
        utility = [
            sum(one.figures(name)["qos per s"].value for one in loads)
            for name in ("margin", "dems", "dems_a")
        ]
        notes.append(
            f"{kind}: margin reaches {share:.1f} % of the clairvoyant bound, "
            f"{utility[0] / max(utility[1:]):.2f} x the better of DEMS and DEMS-A over all "
            f"workloads (least {least:.2f} x); its QoE less GEMS' is {qoe:+.1f} per s at the least"
        )
    return notes


def _ratio(result: LabResult) -> float:
    rivals = (result.figures(name)["qos per s"].value for name in ("dems", "dems_a"))
    return result.figures("margin")["qos per s"].value / max(*rivals, 1e-9)


if __name__ == "__main__":
    typer.run(main)
