"""`aerodaas lab`: compare analytics schedulers in simulation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.deferred import deferred_group
from aerodaas.cli.failure import failure_of, show_failure
from aerodaas.config.extensions import Command, extensions
from aerodaas.errors import AeroDaaSError

__all__ = ["app"]


def _of_extensions() -> tuple[Command, ...]:
    return tuple(one for extension in extensions().values() for one in extension.lab)


app = typer.Typer(
    cls=deferred_group(_of_extensions),
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Compare analytics schedulers in simulation: thousands of drone-minutes in seconds.

    Try `aerodaas lab run`, then add your own class: `--scheduler dems,mine.py:Mine`.
    """,
)

_WORKLOAD = "3D-A"
_SCHEDULERS = "ec_edf,dems,gems,margin"
_FIGURES = ("qos per s", "completion")

Names = Annotated[
    list[str] | None,
    typer.Option(
        "--scheduler",
        "-s",
        help="Comma-separated, or given several times: registered names (`aerodaas lab list`), "
        "`module:Class` or `file.py:Class`. `dems_published` and the like behave as the published "
        f"code. Default: {_SCHEDULERS}.",
    ),
]

Duration = Annotated[
    float | None, typer.Option(help="Simulated seconds; default 300, or the file's.")
]
Edges = Annotated[
    int | None,
    typer.Option(
        help="Simulate so many edges, each with the workload's drones; all cores share them.",
        min=1,
    ),
]
Jobs = Annotated[int | None, typer.Option(help="Processes; default one per core.", min=1)]
Address = Annotated[
    str | None,
    typer.Option(help="Ray cluster (`host:port`, `auto`) whose cores share the edges and seeds."),
]


@contextmanager
def _errors_told() -> Iterator[None]:
    """End the command with an error's message and exit code."""
    try:
        yield
    except AeroDaaSError as error:
        show_failure(failure_of(error))
        raise typer.Exit(error.exit_code) from None


@app.command()
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
            f"`six` for all of the published ones. Default: {_WORKLOAD}.",
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
    address: Address = None,
    plots: Annotated[Path | None, typer.Option(help="Folder for plots.")] = None,
    json_path: Annotated[
        Path | None, typer.Option("--json", help="File for every figure and its interval.")
    ] = None,
    csv_path: Annotated[
        Path | None, typer.Option("--csv", help="The same, one figure to a row.")
    ] = None,
) -> None:
    """Simulate schedulers on the same sample paths and compare them.

    Prints, per workload, means over the seeds with 95 % confidence intervals. *of bound* is the
    QoS utility as a share of what a clairvoyant could reach at most on the very same paths.

        aerodaas lab run -w 2D-A,4D-A -s ec_edf,dems,margin --times lognormal:0.15 --plots out

        aerodaas lab run --edges 1000 --seeds 1 --address auto -s dems,margin

        aerodaas lab run --from runs/patrol/flight.mcap -s dems,margin,mine.py:Mine
    """
    from aerodaas.cli.lab.study import study  # noqa: PLC0415 - loads numpy and the lab

    with _errors_told():
        study(
            ",".join(scheduler or [_SCHEDULERS]),
            ",".join(workload or [_WORKLOAD]),
            flown=flown,
            seeds=seeds,
            network=network,
            times=times,
            duration=duration,
            edges=edges,
            cloud_slots=cloud_slots,
            bound=bound,
            jobs=jobs,
            address=address,
            plots=plots,
            json_path=json_path,
            csv_path=csv_path,
        )


@app.command()
def sweep(
    *,
    sweeps: Annotated[
        list[str],
        typer.Option(
            "--sweep",
            help="`drones=10,20,40`; given several times, all combinations. Of `drones`, `edges`, "
            "`models` (A: six, P: four), `network`, `times`, `cloud_slots`, `duration`, and "
            "`scheduler.KEYWORD`, which goes to the constructors that have it.",
        ),
    ],
    scheduler: Names = None,
    baseline: Annotated[
        str | None,
        typer.Option(help="What the others are compared with. Default: the first scheduler."),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Number of seeds, 0 to N-1.", min=1)] = 20,
    figure: Annotated[
        list[str] | None,
        typer.Option(
            "--figure",
            "-f",
            help="What is printed and plotted, may be given several times: `qos per s`, "
            "`completion`, `qoe per s`, … Default: the first two. The files have all.",
        ),
    ] = None,
    workload: Annotated[
        str, typer.Option("--workload", "-w", help="What is not swept, as for `run`.")
    ] = _WORKLOAD,
    network: Annotated[str, typer.Option(help="As for `run`, where it is not swept.")] = "steady",
    times: Annotated[str, typer.Option(help="As for `run`, where they are not swept.")] = "nominal",
    duration: Duration = None,
    edges: Edges = None,
    cloud_slots: Annotated[
        int | None, typer.Option(help="Executions in the cloud at once; default 32.", min=0)
    ] = None,
    bound: Annotated[
        bool, typer.Option("--bound", help="Compute the clairvoyant bound, too; it takes longer.")
    ] = False,
    jobs: Jobs = None,
    address: Address = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for tables and plots.")] = Path(
        "sweep"
    ),
) -> None:
    """Compare schedulers in every combination of some parameters.

    All see the same sample paths, so they are compared seed by seed: differences from the baseline
    have 95 % intervals (Student's t) and the p of a paired permutation test, corrected by Holm;
    `*` is significant. The folder gets every run as a row of `runs.csv` (`runs.parquet` where
    pyarrow is), the comparisons, and plots for a paper.

        aerodaas lab sweep --sweep drones=2,4,8 -s dems,margin,mine.py:Mine
        aerodaas lab sweep --sweep network=steady,trapezium --sweep cloud_slots=4,16 -s dems,gems
        aerodaas lab sweep --sweep scheduler.slack=10,50,100 -s mine.py:Mine,dems --baseline dems
    """
    from aerodaas.cli.lab.sweep import sweep as run_all  # noqa: PLC0415 - loads numpy and the lab

    with _errors_told():
        run_all(
            ",".join(scheduler or [_SCHEDULERS]),
            sweeps,
            workload=workload,
            seeds=seeds,
            baseline=baseline,
            network=network,
            times=times,
            duration=duration,
            edges=edges,
            cloud_slots=cloud_slots,
            figures=figure or _FIGURES,
            bound=bound,
            jobs=jobs,
            address=address,
            out=out,
        )


@app.command("list")
def list_all() -> None:
    """Show the registered schedulers, the published models and the workloads' names."""
    from aerodaas.cli.lab.study import registered  # noqa: PLC0415 - as above

    registered()
