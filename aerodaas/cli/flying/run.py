"""`aerodaas run`: fly an application, once or for many seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.flying.application import run_application, runtime_option, speed_option
from aerodaas.cli.options import OtherEnvironment, Overrides
from aerodaas.cli.shipped import find_application
from aerodaas.config.extensions import live_views
from aerodaas.config.options import RunOptions
from aerodaas.errors import ConfigError

__all__ = ["run"]


def run(
    context: typer.Context,
    application: Annotated[
        Path,
        typer.Argument(
            help="The application: a Python file, a mission document, or the name of an example."
        ),
    ],
    env: OtherEnvironment = None,
    speed: Annotated[
        str | None,
        typer.Option(
            help="Mission seconds per wall second, or `max`: as fast as the machine goes, "
            "repeatable to the last digit. Default: `max` if every robot is simulated and there "
            "is no --console, else 1."
        ),
    ] = None,
    runtime: Annotated[
        str | None,
        typer.Option(
            help="Where the parts of a flight in simulated time run: `inline`, in this process "
            "(default), or `ray`, cameras and analyses each in a process of its own."
        ),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(help="Where recording, plots and summary go. Default: a folder in runs/."),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Seed of the simulation; with --seeds, the first (0)."),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Analytics scheduler instead of the application's own.")
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Fly this many seeds side by side, and compare them in a table.",
            metavar="N",
        ),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs of --seeds at a time; default one per core.")
    ] = None,
    json_path: Annotated[
        Path | None, typer.Option("--json", help="File for the table of --seeds.")
    ] = None,
    csv_path: Annotated[Path | None, typer.Option("--csv", help="The same as CSV.")] = None,
    address: Annotated[
        str | None, typer.Option(help="Ray cluster to join. Default: RAY_ADDRESS, or none.")
    ] = None,
    setting: Overrides = None,
    view: Annotated[  # noqa: FBT002
        bool, typer.Option("--view/--no-view", help="Show the flight on the terminal.")
    ] = True,
    console: Annotated[  # noqa: FBT002
        bool,
        typer.Option(
            "--console", help="Serve a page from which the flight is watched and commanded."
        ),
    ] = False,
    console_address: Annotated[
        str,
        typer.Option(
            help="Where --console listens; beyond this machine its token goes unencrypted."
        ),
    ] = "127.0.0.1:8360",
    live: Annotated[  # noqa: FBT002
        bool, typer.Option("--live", help="Serve the flight to Foxglove while it goes on.")
    ] = False,
    live_address: Annotated[
        str, typer.Option(help="Where --live listens; on 0.0.0.0 anyone on the network may watch.")
    ] = "127.0.0.1:8765",
    show: Annotated[
        list[str] | None,
        typer.Option(
            metavar="VIEW",
            help=f"Show the flight elsewhere, too: {', '.join(live_views())}. May be repeated.",
        ),
    ] = None,
) -> None:
    """Fly an application.

    Words after `--` are the application's own.

        aerodaas run farm_survey
        aerodaas run my_app.py --speed 5 --seed 7 --record /tmp/farm
        aerodaas run farm_survey --console
        aerodaas run farm_survey --seeds 16 --csv farm.csv
        aerodaas run farm_survey --set quadrotor_base.limits.cruise_speed=1
        aerodaas run situation_awareness --scheduler margin --set simulation.network=outage:60-90
        aerodaas run watch_frames -- pictures/ yolov8n.onnx --rate 5
    """
    from aerodaas.config.overrides import parse_setting  # noqa: PLC0415 - slow to load

    application = find_application(application)
    # Who looks on and commands has the clock's time, unless another speed is asked for.
    factor, simulated_time = speed_option("1" if console and speed is None else speed)
    options = RunOptions(
        environment=env,
        speed=factor,
        simulated_time=simulated_time,
        runtime=runtime_option(runtime),
        seed=seed,
        scheduler=scheduler,
        record=record,
        address=address,
        overrides=dict(parse_setting(text) for text in setting or ()),
        view=view,
        live=live_address if live else None,
        show=tuple(show or ()),
        console=console_address if console else None,
        application=application.resolve(),
    )
    if seeds is not None:
        from aerodaas.cli.flying.seeds.command import run_seeds  # noqa: PLC0415 - slow to load
        from aerodaas.cli.flying.seeds.runs import ApplicationRun  # noqa: PLC0415 - as above

        seeded = ApplicationRun(application, context.args, options)
        run_seeds(seeded, seeds, jobs=jobs, json_path=json_path, csv_path=csv_path)
        return
    _require_seeds({"--jobs": jobs, "--json": json_path, "--csv": csv_path})
    if live:
        typer.echo(f"live: open ws://{live_address} in Foxglove")
    run_application(application, context.args, options)


def _require_seeds(given: dict[str, object]) -> None:
    """Raise ConfigError for what only --seeds takes."""
    for name, value in given.items():
        if value is not None:
            raise ConfigError(f"{name} belongs to --seeds: say how many, as in --seeds 16")
