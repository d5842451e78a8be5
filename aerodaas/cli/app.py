"""The command line: flying, watching, studying, clusters, and recordings."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli import cluster, lab, lease, models, plan, provider, remote, sim
from aerodaas.cli.application import build_application, run_application, speed_option
from aerodaas.cli.attach import attach
from aerodaas.cli.check import check
from aerodaas.cli.examples import examples
from aerodaas.cli.export import export
from aerodaas.cli.failure import failure_of, show_failure
from aerodaas.cli.help_examples import ExampleGroup
from aerodaas.cli.import_bag import import_bag
from aerodaas.cli.init import init
from aerodaas.cli.logs import logs
from aerodaas.cli.new import new
from aerodaas.cli.options import OtherEnvironment, Overrides
from aerodaas.cli.preflight import preflight
from aerodaas.cli.replay import replay
from aerodaas.cli.report import compare, report
from aerodaas.cli.serve import serve
from aerodaas.cli.shipped import find_application
from aerodaas.cli.view import view
from aerodaas.config.options import RunOptions
from aerodaas.environment.signals import heed_interrupts
from aerodaas.types.errors import ConfigError

__all__ = ["app", "main", "run_typer"]

_PROVIDER = "At a provider"

_WORDS = {"allow_extra_args": True}
"""Of commands whose words after `--` are the application's own; a misspelt option is none."""

app = typer.Typer(
    cls=ExampleGroup,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    help="""Program drones as a service.

An application of some 20 lines becomes a dataflow of sensing, analytics and navigation. It flies
a simulated drone, a PX4 or ArduPilot vehicle, a ROS 2 drone or a Tello.

    aerodaas run farm_survey
    aerodaas new my_app
""",
)
app.command()(init)
app.command()(new)
app.command()(examples)
app.add_typer(remote.app, name="remote")
app.add_typer(lab.app, name="lab")
app.add_typer(models.app, name="models")
app.add_typer(plan.app, name="plan")
app.add_typer(sim.app, name="sim")
app.add_typer(cluster.app, name="cluster")
app.add_typer(lease.app, name="lease", rich_help_panel=_PROVIDER)


@app.command(context_settings=_WORDS)
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
    guest: Annotated[
        list[Path] | None,
        typer.Option(
            help="Another's application, in a process of its own, that shares what --grant gives."
        ),
    ] = None,
    grant: Annotated[
        list[str] | None,
        typer.Option(
            metavar="GUEST=RIGHT,…",
            help="What a guest, named after its file, may have: `sense`, `compute` and `fly`, "
            "each alone or as `sense:SENSOR`, `sense:ROBOT`, `compute:ID`, `fly:ROBOT`; and how "
            "much: `analyses:4`, `memory:2048` (MB), `rate:20` (Hz of a source of its own). "
            "Without it, nothing.",
        ),
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
    ros2: Annotated[  # noqa: FBT002
        bool,
        typer.Option(
            "--ros2", help="Publish the flight on ROS 2 topics of the domain ROS_DOMAIN_ID, or 0."
        ),
    ] = False,
) -> None:
    """Fly an application.

    Words after `--` are the application's own.

        aerodaas run farm_survey
        aerodaas run my_app.py --speed 5 --seed 7 --record /tmp/farm
        aerodaas run farm_survey --console
        aerodaas run farm_survey --seeds 16 --csv farm.csv
        aerodaas run farm_survey --set quadrotor_base.limits.cruise_speed=1
        aerodaas run situation_awareness --scheduler margin --set simulation.network=outage:60-90
        aerodaas run mine.py --guest theirs.py --grant theirs=sense:cam1,compute:edge
        aerodaas run watch_frames -- pictures/ yolov8n.onnx --rate 5
    """
    from aerodaas.config.grants import parse_words  # noqa: PLC0415 - slow to load
    from aerodaas.config.overrides import parse_setting  # noqa: PLC0415 - as above
    from aerodaas.ros.link import domain_of  # noqa: PLC0415 - as above

    application = find_application(application)
    # Who looks on and commands has the clock's time, unless another speed is asked for.
    factor, lockstep = speed_option("1" if console and speed is None else speed)
    options = RunOptions(
        environment=env,
        speed=factor,
        lockstep=lockstep,
        seed=seed,
        scheduler=scheduler,
        record=record,
        address=address,
        overrides=dict(parse_setting(text) for text in setting or ()),
        view=view,
        live=live_address if live else None,
        ros2=domain_of(None) if ros2 else None,
        console=console_address if console else None,
        guests=tuple(find_application(path).resolve() for path in guest or ()),
        grants=parse_words(grant or ()),
        application=application.resolve(),
    )
    if seeds is not None:
        from aerodaas.cli.seeds.command import run_seeds  # noqa: PLC0415 - loads ray
        from aerodaas.cli.seeds.job import Job  # noqa: PLC0415 - as above

        job = Job(application, context.args, options)
        run_seeds(job, seeds, jobs=jobs, json_path=json_path, csv_path=csv_path)
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


@app.command("compile", context_settings=_WORDS)
def compile_command(
    context: typer.Context,
    application: Annotated[
        Path, typer.Argument(help="The application: a Python file; or a recording.")
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The document's file; default: printed.")
    ] = None,
    env: OtherEnvironment = None,
) -> None:
    """Write an application as a mission document: data, which others fly without running code.

    The file runs up to `start_mission()`. Words after `--` are the application's own. Of a
    recording, it is the document that was flown.

        aerodaas compile my_app.py -o my_app.json
        aerodaas run my_app.json
        aerodaas compile flight.mcap | diff my_app.json -
    """
    from aerodaas.environment.document.flying import (  # noqa: PLC0415
        compile_application,
        recorded_document,
    )

    if application.suffix == ".mcap":
        document = recorded_document(application)
    else:
        document = compile_application(find_application(application), context.args, env)
    _put(document.text(), output)


def _put(text: str, output: Path | None) -> None:
    """Print a text, or write it into a file; raises ConfigError if that cannot be."""
    if output is None:
        typer.echo(text, nl=False)
        return
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {output}: {error.strerror}") from None


@app.command("graph", context_settings=_WORDS)
def graph_command(
    context: typer.Context,
    application: Annotated[Path, typer.Argument(help="The application, as for `aerodaas run`.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="A file; default: printed.")
    ] = None,
    env: OtherEnvironment = None,
) -> None:
    """Draw an application's graph as a Mermaid flowchart; nothing flies.

    Sites that show Markdown draw it, such as GitHub's; so does https://mermaid.live.

        aerodaas graph farm_survey
        aerodaas graph my_app.py -o graph.mmd
    """
    from aerodaas.dataflow.drawing import mermaid  # noqa: PLC0415 - slow to load

    application = find_application(application)
    options = RunOptions(application=application.resolve(), environment=env, view=False)
    _put(mermaid(build_application(application, context.args, options).graph), output)


app.command(context_settings=_WORDS)(check)
app.command()(preflight)
app.command()(logs)


@app.command()
def schema() -> None:
    """Print the JSON schema of environment files.

    aerodaas schema > environment.schema.json
    """
    from aerodaas.config.schema import environment_schema  # noqa: PLC0415 - slow to load

    typer.echo(environment_schema(), nl=False)


@app.command()
def doctor(
    address: Annotated[str | None, typer.Option(help="Ray cluster to check, too.")] = None,
) -> None:
    """Say what this machine can do.

    aerodaas doctor
    """
    from aerodaas.cli.doctor import examine  # noqa: PLC0415 - only here

    raise typer.Exit(0 if examine(address) else 1)


app.command()(serve)
app.command()(view)
app.command()(report)
app.command()(attach)
app.command()(compare)
app.command()(export)
app.command("import")(import_bag)
app.command(context_settings=_WORDS)(replay)
for _command in (
    provider.login,
    provider.fleet,
    provider.missions,
    provider.watch,
    provider.cancel,
    provider.grant,
    provider.fetch,
):
    app.command(rich_help_panel=_PROVIDER)(_command)
app.command(
    rich_help_panel=_PROVIDER,
    context_settings=_WORDS,
)(provider.submit)


def main() -> None:
    """Run the command line."""
    heed_interrupts()
    run_typer(app)


def run_typer(typer_app: typer.Typer, name: str | None = None) -> None:
    """Run a Typer application as a program; errors become one message and an exit code."""
    try:
        typer_app(standalone_mode=True, prog_name=name)
    except Exception as error:  # noqa: BLE001 - the application may raise anything
        failure = failure_of(error)
        show_failure(failure)
        sys.exit(failure.code)
