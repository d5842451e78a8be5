"""`aerodaas lab`: compare analytics schedulers in simulation."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

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
    run_lab,
)
from aerodaas.schedulers.lab.metrics import Score, score
from aerodaas.schedulers.lab.run import Spread
from aerodaas.schedulers.lab.workload import SIX
from aerodaas.types.clock import NANOSECONDS
from aerodaas.types.errors import AeroDaaSError

__all__ = ["app", "result_table"]

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Compare analytics schedulers in simulation: thousands of drone-minutes in seconds.

    Try `aerodaas lab run`, then add your own class: `--scheduler dems,mine.py:Mine`.
    """,
)

Names = Annotated[
    str,
    typer.Option(
        "--scheduler",
        "-s",
        help="Comma-separated: registered names (`aerodaas lab list`), `module:Class` or "
        "`file.py:Class`. `dems_published` and the like behave as the published code.",
    ),
]


@app.command()
def run(
    *,
    workload: Annotated[
        str,
        typer.Option(
            "--workload",
            "-w",
            help="Comma-separated: `3D-A` is 3 drones with all six models on one edge, `4D-P` "
            "four models, `80D-A/7` 80 drones over 7 edges; or a JSON file; `six` for all of "
            "the published ones.",
        ),
    ] = "3D-A",
    flown: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="A recorded flight (`flight.mcap`) instead of a workload: its tasks as they "
            "came, with the execution times observed.",
        ),
    ] = None,
    scheduler: Names = "ec_edf,dems,gems,margin",
    seeds: Annotated[int, typer.Option(help="Number of seeds, 0 to N-1.", min=1)] = 10,
    network: Annotated[
        str,
        typer.Option(
            help="`steady`, `trapezium[:MS]` (latency rises and falls), `outage[:30-45,80-81]` "
            "(seconds), `trace:FILE` (CSV of seconds, Mbit/s); joined by `+`.",
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
    duration: Annotated[
        float | None, typer.Option(help="Simulated seconds; default 300, or the file's.")
    ] = None,
    cloud_slots: Annotated[
        int | None,
        typer.Option(help="Executions in the cloud at once; default 32, or the flight's.", min=0),
    ] = None,
    bound: Annotated[
        bool | None,
        typer.Option(help="Compute the clairvoyant bound; by default for up to 10 edges."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(help="Processes; default one per core.", min=1)
    ] = None,
    address: Annotated[
        str | None,
        typer.Option(help="Ray cluster (`host:port`, `auto`) whose cores share the seeds."),
    ] = None,
    plots: Annotated[Path | None, typer.Option(help="Folder for plots.")] = None,
    json_path: Annotated[
        Path | None, typer.Option("--json", help="File for every figure and its interval.")
    ] = None,
) -> None:
    """Simulate schedulers on the same sample paths and compare them.

    Prints, per workload, means over the seeds with 95 % confidence intervals. *of bound* is the
    QoS utility as a share of what a clairvoyant could reach at most on the very same paths.

        aerodaas lab run -w 2D-A,4D-A -s ec_edf,dems,margin --times lognormal:0.15 --plots out

        aerodaas lab run --from runs/patrol/flight.mcap -s dems,margin,mine.py:Mine
    """
    try:
        results: list[LabResult] = []
        names = [name.strip() for name in scheduler.split(",")]
        loads, resources, as_flown = _loads(workload, flown, duration)
        if cloud_slots is not None:
            resources = Resources(cloud_slots=cloud_slots)
        spread, wanted = _spread(address, names)
        for load in loads:
            with_bound = load.edges <= 10 if bound is None else bound  # noqa: PLR2004 - see help
            with _progress() as progress:
                bar = progress.add_task(load.name, total=seeds * load.edges)
                result = run_lab(
                    load,
                    wanted,
                    range(seeds),
                    network=Network.named(network, load.duration),
                    times=ExecutionTimes.named(times),
                    resources=resources,
                    bound=with_bound,
                    jobs=jobs,
                    spread=spread,
                    progress=lambda done, _: progress.update(bar, completed=done),  # noqa: B023
                )
            if as_flown is not None:
                result.scores["as flown"] = [as_flown] * seeds
            results.append(result)
            Console().print(result_table(result))
            if plots is not None:
                _plot(result, names, resources, plots)
        if json_path is not None:
            json_path.write_text(json.dumps([r.as_json() for r in results], indent=1))
    except AeroDaaSError as error:
        Console(stderr=True).print(f"[red]error:[/red] {error}", highlight=False)
        raise typer.Exit(error.exit_code) from None


@app.command("list")
def list_all() -> None:
    """Show the registered schedulers, the published models and the workloads' names."""
    table = Table("name", "scheduler", title="Schedulers")
    for name in scheduler_names():
        text = (type(load_scheduler(name)).__doc__ or "").strip().splitlines()[0]
        table.add_row(name, text)
    Console().print(table)
    columns = ("benefit", "deadline ms", "edge ms", "cloud ms", "edge cost", "cloud cost", "QoE")
    models = Table("model", title="Models of the published evaluation")
    for column in columns:
        models.add_column(column, justify="right")
    for name, p in PUBLISHED.items():
        clock = (p.deadline / MILLISECOND, p.edge_time / MILLISECOND, p.cloud_time / MILLISECOND)
        bonus = p.qoe.bonus if p.qoe else 0
        figures = (p.benefit, *clock, p.edge_cost, p.cloud_cost, bonus)
        models.add_row(name, *(f"{figure:g}" for figure in figures))
    Console().print(models)
    Console().print(f"Workloads: {', '.join(SIX)}, NNND-A/EDGES, or a JSON file", highlight=False)


def result_table(result: LabResult) -> Table:
    """The table that `run` prints."""
    title = (
        f"{result.workload.name}: {result.workload.duration / 1e9:g} s, "
        f"{result.network.name} network, {result.times.name} times, {len(result.seeds)} seeds"
    )
    table = Table(title=title, title_justify="left")
    table.add_column("scheduler")
    shares = ("completion", "late", "dropped", "migrated", "stolen", "edge use", "of bound")
    columns = ["qos per s", "of bound", "completion", "qoe per s", "late", "dropped"]
    columns += ["migrated", "stolen", "edge use", "cloud use", "cost per s"]
    if result.bounds is None:
        columns.remove("of bound")
    for column in columns:
        table.add_column(f"{column} %" if column in shares else column, justify="right")
    best = max(result.figures(name)["qos per s"].value for name in result.scores)
    for name in result.scores:
        figures = result.figures(name)
        cells = []
        for column in columns:
            scale = 100 if column in shares else 1
            mean = figures[column]
            margin = "" if isnan(mean.margin) else f" ±{mean.margin * scale:.1f}"
            cells.append(f"{mean.value * scale:.1f}{margin}")
        style = "bold" if figures["qos per s"].value == best else None
        table.add_row(name, *cells, style=style)
    return table


def _workload(name: str, duration: float | None) -> Workload:
    found = load_workload(name) if name.endswith(".json") else Workload.named(name)
    return found if duration is None else found.lasting(round(duration * NANOSECONDS))


def _spread(
    address: str | None, names: list[str]
) -> tuple[Spread | None, Sequence[str | type[AnalyticsScheduler]]]:
    if address is None:
        return None, names
    from aerodaas.actors.cluster.ray_map import shipped, spread_over  # noqa: PLC0415 - loads ray

    return spread_over(address), [shipped(name) for name in names]


def _loads(
    names: str, flown: Path | None, duration: float | None
) -> tuple[list[Workload], Resources, Score | None]:
    """The workloads, their resources, and the score of a recorded flight itself."""
    if flown is None:
        wanted = SIX if names == "six" else names.split(",")
        return [_workload(name.strip(), duration) for name in wanted], Resources(), None
    # Reading a recording takes libraries that simulating does not.
    from aerodaas.cli.flown_tasks import Flown  # noqa: PLC0415
    from aerodaas.cli.flown_workload import flown_trace, flown_workload  # noqa: PLC0415

    flight = Flown.read(flown)
    workload = flown_workload(flight)
    tasks = workload.tasks(0, random.Random())
    return [workload], flight.resources, score(tasks, flown_trace(flight, tasks))


def _progress() -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    return Progress(*columns, TimeRemainingColumn(), console=Console(), transient=True)


def _plot(result: LabResult, names: list[str], resources: Resources, folder: Path) -> None:
    require_extra("plots", "a plot")
    # Matplotlib takes most of a second to import, which a table alone need not pay.
    from aerodaas.schedulers.lab.plots import (  # noqa: PLC0415
        plot_bars,
        plot_observations,
        plot_timeline,
    )
    from aerodaas.schedulers.lab.sample import SamplePath  # noqa: PLC0415
    from aerodaas.schedulers.lab.simulator import simulate  # noqa: PLC0415

    folder.mkdir(parents=True, exist_ok=True)
    stem = "".join(
        c if c.isalnum() else "_" for c in f"{result.workload.name} {result.network.name}"
    )
    plot_bars(result, folder / f"{stem}_bars.png")
    path = SamplePath.draw(result.workload, 0, result.seeds[0], result.times, result.network)
    middle = result.workload.duration / 2e9
    traces = {}
    for name in names:
        traces[name] = simulate(path, load_scheduler(name), resources, record=True)
        title = f"{name} on edge 0 of {result.workload.name}, seed {result.seeds[0]}"
        file = folder / f"{stem}_timeline_{_file_name(name)}.png"
        plot_timeline(traces[name], file, title, middle, middle + 6)
    plot_observations(traces, path, folder / f"{stem}_over_time.png")
    Console().print(f"plots in {folder}", highlight=False)


def _file_name(text: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in text)
