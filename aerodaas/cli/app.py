"""The command line: flying, watching, studying, clusters, and recordings."""

from __future__ import annotations

import sys

import typer

from aerodaas.cli.deferred import deferred_group
from aerodaas.config.extensions import Command, extensions
from aerodaas.environment.signals import heed_interrupts

__all__ = ["app", "commands", "main", "run_typer"]

_PROVIDER = "At a provider"

_CORE = (
    Command(
        "init",
        "aerodaas.cli.init:init",
        "Write an environment file, and beside it the schema by which editors explain it.",
    ),
    Command(
        "new",
        "aerodaas.cli.shipped:new",
        "Begin an application: a folder with its file, an environment, a test, a README.",
    ),
    Command(
        "examples",
        "aerodaas.cli.shipped:examples",
        "Copy the applications that ship, with their environments, to read and to change.",
    ),
    Command("run", "aerodaas.cli.flying.run:run", "Fly an application.", words=True),
    Command(
        "compile",
        "aerodaas.cli.flying.document:compile_document",
        "Write an application as a mission document that others fly without its code, or draw it.",
        words=True,
    ),
    Command(
        "check",
        "aerodaas.cli.flying.check:check",
        "Try everything that a flight needs, without flying.",
        words=True,
    ),
    Command(
        "schema",
        "aerodaas.cli.flying.document:schema",
        "Print the JSON schema of environment files, or of mission documents.",
    ),
    Command("doctor", "aerodaas.cli.doctor:doctor", "Say what this machine can do."),
    Command(
        "serve",
        "aerodaas.cli.provider.serve:serve",
        "Offer a fleet of drones: users' applications fly on it by URL.",
    ),
    Command(
        "view",
        "aerodaas.cli.recordings.report:view",
        "Play a recording in a browser: map, video, state and charts, by one timeline.",
    ),
    Command(
        "report",
        "aerodaas.cli.recordings.report:report",
        "Write a recording's report: one HTML page, its plots as PNG, and the figures as JSON.",
    ),
    Command(
        "export",
        "aerodaas.cli.recordings.export:app",
        "Write parts of a recording for other programs.",
    ),
    Command(
        "replay",
        "aerodaas.cli.recordings.replay:replay",
        "Feed a recording's sensors through an application, and say how its decisions differ.",
        words=True,
    ),
    Command(
        "login",
        "aerodaas.cli.provider.provider:login",
        "Store the token of your account at a provider, for you alone (mode 0600).",
        panel=_PROVIDER,
    ),
    Command(
        "fleet",
        "aerodaas.cli.provider.provider:fleet",
        "Show a provider's drones: free or leased, their charge, where they are, and their health.",
        panel=_PROVIDER,
    ),
    Command(
        "missions",
        "aerodaas.cli.provider.missions:app",
        "List, watch, approve and cancel missions at a provider, grant cameras, fetch recordings.",
        panel=_PROVIDER,
    ),
    Command(
        "submit",
        "aerodaas.cli.provider.provider:submit",
        "Fly an application on a provider's drones, unchanged but for the address.",
        panel=_PROVIDER,
        words=True,
    ),
    Command(
        "remote",
        "aerodaas.cli.provider.remote:app",
        "Take part in a mission that is flying.",
    ),
    Command(
        "lab",
        "aerodaas.cli.lab.app:app",
        "Compare analytics schedulers in simulation: thousands of drone-minutes in seconds.",
    ),
    Command(
        "models",
        "aerodaas.cli.models:app",
        "Detectors and pose models: fetch by name, try, and measure.",
    ),
    Command("cluster", "aerodaas.cli.cluster:app", "Edge and cloud as one cluster."),
    Command(
        "lease",
        "aerodaas.cli.provider.lease:app",
        "Lease a provider's drones: while a lease lasts, its tenant alone flies them.",
        panel=_PROVIDER,
    ),
)
"""The core's commands, in the order in which `--help` lists them."""


def commands() -> tuple[Command, ...]:
    """Every command: the core's, then those of extensions."""
    return (*_CORE, *(one for extension in extensions().values() for one in extension.commands))


app = typer.Typer(
    cls=deferred_group(commands),
    # Typer takes an application without a command for a mistake.
    callback=lambda: None,
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


def main() -> None:
    """Run the command line."""
    heed_interrupts()
    run_typer(app)


def run_typer(typer_app: typer.Typer, name: str | None = None) -> None:
    """Run a Typer application as a program; errors become one message and an exit code."""
    try:
        typer_app(standalone_mode=True, prog_name=name)
    except Exception as error:  # noqa: BLE001 - the application may raise anything
        from aerodaas.cli.failure import failure_of, show_failure  # noqa: PLC0415 - slow to load

        failure = failure_of(error)
        show_failure(failure)
        sys.exit(failure.code)
