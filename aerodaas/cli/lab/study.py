"""The work of `aerodaas lab`: simulations, tables and plots."""

from __future__ import annotations

import csv
import json
import random
from collections.abc import Sequence
from math import isnan
from pathlib import Path

import typer
from rich.console import Console
from rich.table import Table

from aerodaas.clock import NANOSECONDS
from aerodaas.config.extras import require_extra
from aerodaas.schedulers.analytics.base import MILLISECOND, AnalyticsScheduler, Resources
from aerodaas.schedulers.analytics.published.profiles import PUBLISHED
from aerodaas.schedulers.analytics.registry import load_scheduler, scheduler_names
from aerodaas.schedulers.lab import (
    ExecutionTimes,
    LabResult,
    Network,
    Workload,
    load_workload,
    read_arrivals,
    run_lab,
)
from aerodaas.schedulers.lab.arrival_trace import TRACE
from aerodaas.schedulers.lab.metrics import Score, score
from aerodaas.schedulers.lab.run import Spread
from aerodaas.schedulers.lab.workload import SIX
from aerodaas.terminal.figures import Row, show_figures
from aerodaas.terminal.progress import show_progress

__all__ = ["registered", "spread_of", "study", "workload_of"]

_BOUND_EDGES = 10
"""Most edges for which the clairvoyant bound is computed unasked."""


def study(
    scheduler: str,
    workload: str,
    *,
    flown: Path | None,
    seeds: int,
    network: str,
    times: str,
    duration: float | None,
    edges: int | None,
    cloud_slots: int | None,
    bound: bool | None,
    jobs: int | None,
    address: str | None,
    plots: Path | None,
    json_path: Path | None,
    csv_path: Path | None,
) -> None:
    """Compare schedulers and print the tables; the arguments are those of `aerodaas lab run`."""
    results: list[LabResult] = []
    names = [name.strip() for name in scheduler.split(",")]
    loads, resources, as_flown = _loads(workload, flown, duration, edges)
    if cloud_slots is not None:
        resources = Resources(cloud_slots=cloud_slots)
    spread, wanted = spread_of(address, names)
    for load in loads:
        with show_progress() as progress:
            bar = progress.add_task(load.name, total=seeds * load.edges)
            result = run_lab(
                load,
                wanted,
                range(seeds),
                network=Network.named(network, load.duration),
                times=ExecutionTimes.named(times),
                resources=resources,
                bound=load.edges <= _BOUND_EDGES if bound is None else bound,
                jobs=jobs,
                spread=spread,
                progress=lambda done, _: progress.update(bar, completed=done),  # noqa: B023
            )
        if as_flown is not None:
            result.scores["as flown"] = [as_flown] * seeds
        results.append(result)
        _show(result)
        if plots is not None:
            _plot(result, names, resources, plots)
    if json_path is not None:
        json_path.write_text(json.dumps([r.as_json() for r in results], indent=1))
    if csv_path is not None:
        _write_csv(results, csv_path)


def _write_csv(results: list[LabResult], path: Path) -> None:
    """Write every figure as a row of its own, as pandas and R want it."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("workload", "network", "times", "scheduler", "figure", "mean", "margin"))
        for result in results:
            case = (result.workload.name, result.network.name, result.times.name)
            for name in result.scores:
                for figure, mean in result.figures(name).items():
                    writer.writerow((*case, name, figure, mean.value, mean.margin))


def registered() -> None:
    """Print the registered schedulers, the published models and the workloads' names."""
    table = Table("name", "scheduler", title="Schedulers")
    for name in scheduler_names():
        text = (type(load_scheduler(name)).__doc__ or "").strip().splitlines()[0]
        table.add_row(name, text)
    Console().print(table)
    columns = ("benefit", "deadline ms", "edge ms", "cloud ms", "edge cost", "cloud cost", "QoE")
    models: list[Row] = []
    for name, p in PUBLISHED.items():
        clock = (p.deadline / MILLISECOND, p.edge_time / MILLISECOND, p.cloud_time / MILLISECOND)
        bonus = p.qoe.bonus if p.qoe else 0
        figures = (p.benefit, *clock, p.edge_cost, p.cloud_cost, bonus)
        models.append(Row(name, [f"{figure:g}" for figure in figures]))
    show_figures("Models of the published evaluation", "model", columns, models)
    Console().print(f"Workloads: {', '.join(SIX)}, NNND-A/EDGES, or a JSON file", highlight=False)


def _show(result: LabResult) -> None:
    """Print the table of `run`."""
    seeds = f"{len(result.seeds)} seeds" if len(result.seeds) > 1 else "1 seed"
    if result.edges and result.workload.edges > 1:
        seeds += f", intervals over {result.workload.edges} edges"
    title = (
        f"{result.workload.name}: {result.workload.duration / 1e9:g} s, "
        f"{result.network.name} network, {result.times.name} times, {seeds}"
    )
    shares = ("completion", "late", "dropped", "migrated", "stolen", "edge use", "of bound")
    columns = ["qos per s", "of bound", "completion", "qoe per s", "late", "dropped"]
    columns += ["migrated", "stolen", "edge use", "cloud use", "cost per s"]
    if result.bounds is None:
        columns.remove("of bound")
    best = max(result.figures(name)["qos per s"].value for name in result.scores)
    rows = []
    for name in result.scores:
        figures = result.figures(name)
        cells = []
        for column in columns:
            scale = 100 if column in shares else 1
            mean = figures[column]
            margin = "" if isnan(mean.margin) else f" ±{mean.margin * scale:.1f}"
            cells.append(f"{mean.value * scale:.1f}{margin}")
        rows.append(Row(name, cells, bold=figures["qos per s"].value == best))
    headings = [f"{column} %" if column in shares else column for column in columns]
    show_figures(title, "scheduler", headings, rows)


def workload_of(name: str, duration: float | None, edges: int | None) -> Workload:
    """The workload of a name, a JSON file or a trace; raises UnknownIdError, SchedulerError."""
    lasts = None if duration is None else round(duration * NANOSECONDS)
    if name.startswith(TRACE):
        found = read_arrivals(name.removeprefix(TRACE), lasts)
    else:
        found = load_workload(name) if name.endswith(".json") else Workload.named(name)
    if edges is not None:
        found = found.on_edges(edges)
    return found if lasts is None else found.lasting(lasts)


def spread_of(
    address: str | None, names: list[str]
) -> tuple[Spread | None, Sequence[str | type[AnalyticsScheduler]]]:
    """Executor that shares the seeds over a cluster, if there is one, and the schedulers for it."""
    if address is None:
        return None, names
    from aerodaas.actors.cluster.ray_map import shipped, spread_over  # noqa: PLC0415 - loads ray

    return spread_over(address), [shipped(name) for name in names]


def _loads(
    names: str, flown: Path | None, duration: float | None, edges: int | None
) -> tuple[list[Workload], Resources, Score | None]:
    """The workloads, their resources, and the score of a recorded flight itself."""
    if flown is None:
        wanted = SIX if names == "six" else names.split(",")
        return [workload_of(name.strip(), duration, edges) for name in wanted], Resources(), None
    # Reading a recording takes libraries that simulating does not.
    from aerodaas.cli.lab.recorded_workload import (  # noqa: PLC0415
        RecordedWorkload,
        flown_trace,
        flown_workload,
    )

    flight = RecordedWorkload.read(flown)
    workload = flown_workload(flight)
    if edges is not None:
        workload = workload.on_edges(edges)
    tasks = workload.tasks(0, random.Random())
    return [workload], flight.resources, score(tasks, flown_trace(flight, tasks))


def _plot(result: LabResult, names: list[str], resources: Resources, folder: Path) -> None:
    require_extra("plots", "a plot")
    # Matplotlib takes most of a second to import, which a table alone need not pay.
    from aerodaas.schedulers.lab.plots import plot_bars, plot_timeline  # noqa: PLC0415
    from aerodaas.schedulers.lab.sample import SamplePath  # noqa: PLC0415
    from aerodaas.schedulers.lab.simulator import simulate  # noqa: PLC0415

    folder.mkdir(parents=True, exist_ok=True)
    stem = "".join(
        c if c.isalnum() else "_" for c in f"{result.workload.name} {result.network.name}"
    )
    plot_bars(result, folder / f"{stem}_bars.png")
    path = SamplePath.draw(result.workload, 0, result.seeds[0], result.times, result.network)
    middle = result.workload.duration / 2e9
    for name in names:
        trace = simulate(path, load_scheduler(name), resources)
        title = f"{name} on edge 0 of {result.workload.name}, seed {result.seeds[0]}"
        file = folder / f"{stem}_timeline_{_file_name(name)}.png"
        plot_timeline(trace, file, title, middle, middle + 6)
    typer.echo(f"plots in {folder}")


def _file_name(text: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in text)
