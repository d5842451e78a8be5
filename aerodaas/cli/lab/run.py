"""`aerodaas lab run` and `list`: simulations, tables and plots."""

from __future__ import annotations

import random
from math import isnan
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from aerodaas.cli.lab.options import (
    WORKLOAD,
    Duration,
    Edges,
    Jobs,
    Names,
    names_of,
    workload_of,
    write_csv,
)
from aerodaas.config.extras import require_extra
from aerodaas.schedulers.analytics.base import MILLISECOND, Resources
from aerodaas.schedulers.analytics.published.profiles import PUBLISHED
from aerodaas.schedulers.analytics.registry import load_scheduler, scheduler_names
from aerodaas.schedulers.lab import ExecutionTimes, LabResult, Network, Workload, run_lab
from aerodaas.schedulers.lab.metrics import Score, score
from aerodaas.schedulers.lab.workload import SIX
from aerodaas.terminal.figures import Row, show_figures
from aerodaas.terminal.progress import show_progress

__all__ = ["list_all", "run"]

_BOUND_EDGES = 10
"""Most edges for which the clairvoyant bound is computed unasked."""


def run(
    *,
    workload: Annotated[
        list[str] | None,
        typer.Option(
            "--workload",
            "-w",
            help="Comma-separated, or given several times: `3D-A` is 3 drones with all six models "
            "on one edge, `4D-P` four models, `80D-A/7` 80 drones over 7 edges; or a JSON file; "
            "or `trace:FILE`, arrivals in a CSV; "
            f"`six` for all of the published ones. Default: {WORKLOAD}.",
        ),
    ] = None,
    flown: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="A recorded flight (`flight.mcap`) instead of a workload: its tasks as they "
            "came, with the execution times observed.",
        ),
    ] = None,
    scheduler: Names = None,
    seeds: Annotated[int, typer.Option(help="Number of seeds, 0 to N-1.", min=1)] = 10,
    network: Annotated[
        str,
        typer.Option(
            help="`steady`, `trapezium[:MS]` (latency rises and falls), `outage[:30-45,80-81]` "
            "(seconds), `trace:FILE` (measured bandwidth: Mahimahi, Pensieve, or a CSV of seconds, "
            "Mbit/s); joined by `+`.",
        ),
    ] = "steady",
    times: Annotated[
        str,
        typer.Option(
            help="`nominal`, or drawn around the table's times with a coefficient of variation: "
            "`lognormal:0.15`, `gamma:0.15`; `lognormal:0.15@0.95` takes the table's times as "
            "95th percentiles instead of means."
        ),
    ] = "nominal",
    duration: Duration = None,
    edges: Edges = None,
    cloud_slots: Annotated[
        int | None,
        typer.Option(help="Executions in the cloud at once; default 32, or the flight's.", min=0),
    ] = None,
    bound: Annotated[
        bool | None,
        typer.Option(help="Compute the clairvoyant bound; by default for up to 10 edges."),
    ] = None,
    jobs: Jobs = None,
    plots: Annotated[Path | None, typer.Option(help="Folder for plots.")] = None,
    csv_path: Annotated[
        Path | None,
        typer.Option("--csv", help="File for every figure and its interval, one to a row."),
    ] = None,
) -> None:
    """Simulate schedulers on the same sample paths and compare them.

    Prints, per workload, means over the seeds with 95 % confidence intervals. *of bound* is the
    QoS utility as a share of what a clairvoyant could reach at most on the very same paths.

        aerodaas lab run -w 2D-A,4D-A -s ec_edf,dems,margin --times lognormal:0.15 --plots out

        aerodaas lab run --edges 1000 --seeds 1 -s dems,margin

        aerodaas lab run --from runs/patrol/flight.mcap -s dems,margin,mine.py:Mine
    """
    results: list[LabResult] = []
    names = names_of(scheduler)
    workloads = ",".join(workload or [WORKLOAD])
    loads, resources, as_flown = _loads(workloads, flown, duration, edges)
    if cloud_slots is not None:
        resources = Resources(cloud_slots=cloud_slots)
    for load in loads:
        with show_progress() as progress:
            bar = progress.add_task(load.name, total=seeds * load.edges)
            result = run_lab(
                load,
                names,
                range(seeds),
                network=Network.named(network, load.duration),
                times=ExecutionTimes.named(times),
                resources=resources,
                bound=load.edges <= _BOUND_EDGES if bound is None else bound,
                jobs=jobs,
                progress=lambda done, _: progress.update(bar, completed=done),  # noqa: B023
            )
        if as_flown is not None:
            result.scores["as flown"] = [as_flown] * seeds
        results.append(result)
        _show(result)
        if plots is not None:
            _plot(result, names, resources, plots)
    if csv_path is not None:
        write_csv(csv_path, [row for result in results for row in _tidy_rows(result)])


def _tidy_rows(result: LabResult) -> list[dict[str, Any]]:
    """Every figure as a row of its own, as pandas and R want it."""
    case = {
        "workload": result.workload.name,
        "network": result.network.name,
        "times": result.times.name,
    }
    return [
        {**case, "scheduler": name, "figure": figure, "mean": mean.value, "margin": mean.margin}
        for name in result.scores
        for figure, mean in result.figures(name).items()
    ]


def list_all() -> None:
    """Show the registered schedulers, the published models and the workloads' names."""
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
