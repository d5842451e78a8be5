"""`aerodaas lab`: compare analytics schedulers in simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from aerodaas.cli.help_examples import ExampleGroup
from aerodaas.types.errors import AeroDaaSError

__all__ = ["app"]

app = typer.Typer(
    cls=ExampleGroup,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Compare analytics schedulers in simulation: thousands of drone-minutes in seconds.

    Try `aerodaas lab run`, then add your own class: `--scheduler dems,mine.py:Mine`.
    """,
)

_WORKLOAD = "3D-A"
_SCHEDULERS = "ec_edf,dems,gems,margin"

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
    csv_path: Annotated[
        Path | None, typer.Option("--csv", help="The same, one figure to a row.")
    ] = None,
) -> None:
    """Simulate schedulers on the same sample paths and compare them.

    Prints, per workload, means over the seeds with 95 % confidence intervals. *of bound* is the
    QoS utility as a share of what a clairvoyant could reach at most on the very same paths.

        aerodaas lab run -w 2D-A,4D-A -s ec_edf,dems,margin --times lognormal:0.15 --plots out

        aerodaas lab run --from runs/patrol/flight.mcap -s dems,margin,mine.py:Mine
    """
    from aerodaas.cli.lab_study import study  # noqa: PLC0415 - loads numpy and the lab

    try:
        study(
            ",".join(scheduler or [_SCHEDULERS]),
            ",".join(workload or [_WORKLOAD]),
            flown=flown,
            seeds=seeds,
            network=network,
            times=times,
            duration=duration,
            cloud_slots=cloud_slots,
            bound=bound,
            jobs=jobs,
            address=address,
            plots=plots,
            json_path=json_path,
            csv_path=csv_path,
        )
    except AeroDaaSError as error:
        Console(stderr=True).print(f"[red]error:[/red] {error}", highlight=False)
        raise typer.Exit(error.exit_code) from None


@app.command("list")
def list_all() -> None:
    """Show the registered schedulers, the published models and the workloads' names."""
    from aerodaas.cli.lab_study import registered  # noqa: PLC0415 - as above

    registered()
