"""Commands at a provider's service: login, its fleet, and the submission of a mission."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodaas.cli.flying.application import run_application, submit_application
from aerodaas.cli.shipped import find_application
from aerodaas.config.options import ProviderOptions, RunOptions
from aerodaas.errors import ConfigError

if TYPE_CHECKING:
    from pydantic import BaseModel

    from aerodaas.environment.provider.client import ProviderClient
    from aerodaas.protocol.schemas import RobotOut

__all__ = [
    "At",
    "Json",
    "client_at",
    "fleet",
    "login",
    "moment",
    "print_json",
    "print_table",
    "submit",
]

_WIDE = 1000
"""Columns of a table that goes into a pipe."""
At = Annotated[
    str | None,
    typer.Option(
        "--at",
        metavar="URL",
        envvar="AERODAAS_PROVIDER",
        help="The provider. Default: the only one that you are logged in at.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="For programs.")]


def client_at(at: str | None) -> ProviderClient:
    """The client of the provider at an address, or of the only one that one is logged in at."""
    from aerodaas.environment.provider.logins import (  # noqa: PLC0415 - slow to load
        client_for,
        default_url,
    )

    return client_for(at or default_url())


def print_json(found: BaseModel | Sequence[BaseModel]) -> None:
    """Print an answer, or a list of them, as JSON."""
    content: Any = (
        [one.model_dump(mode="json") for one in found]
        if isinstance(found, list | tuple)
        else found.model_dump(mode="json")  # type: ignore[union-attr]
    )
    typer.echo(json.dumps(content, indent=2))


def moment(seconds: float) -> str:
    """A moment, seconds of Unix time, as this machine's date and time."""
    from datetime import datetime  # noqa: PLC0415 - only for tables

    return f"{datetime.fromtimestamp(seconds).astimezone():%Y-%m-%d %H:%M:%S}"


def print_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table of texts, which are another's and are taken for no markup."""
    from rich.console import Console  # noqa: PLC0415 - only for tables
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    table = Table(box=None, title=Text(title), title_justify="left", header_style="dim")
    for head in heads:
        table.add_column(head)
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    # What reads a pipe has no width to keep to.
    width = None if sys.stdout.isatty() else _WIDE
    Console(highlight=False, width=width).print(table)


_READY = {"good": "ready", "warning": "warned", "refused": "refused"}
"""What the list before take-off says, by the gravest of its items."""


def login(
    url: Annotated[str, typer.Argument(help="The provider: https://host.")],
    forget: Annotated[bool, typer.Option("--forget", help="Remove the stored token.")] = False,  # noqa: FBT002
) -> None:
    """Store the token of your account at a provider, for you alone (mode 0600).

    It is asked for, or read from a pipe, and tried. The provider's administrator makes it. The
    environment variable AERODAAS_TOKEN goes before it.

        aerodaas login https://provider.example
        aerodaas login https://provider.example < token.txt
    """
    from aerodaas.environment.provider.address import (  # noqa: PLC0415 - slow to load
        INSECURE_VARIABLE,
        ServiceAddress,
    )
    from aerodaas.environment.provider.logins import Logins, client_for  # noqa: PLC0415

    address = ServiceAddress.parse(url, insecure=os.environ.get(INSECURE_VARIABLE) == "1")
    if forget:
        known = Logins().forget(address)
        typer.echo(f"{'forgot the' if known else 'there was no'} token for {address.base}")
        return
    if sys.stdin.isatty():
        token = typer.prompt(f"token for {address.base}", hide_input=True)
    else:
        token = sys.stdin.read()
    account = client_for(url, token.strip() or _missing_token()).me()
    logins = Logins()
    logins.store(address, token.strip())
    typer.echo(
        f"{account.name} of {account.tenant} ({account.role.value}); stored in {logins.path}"
    )


def fleet(at: At = None, as_json: Json = False) -> None:  # noqa: FBT002
    """Show a provider's drones: free or leased, their charge, where they are, and their health.

    A `refused` take-off, or the warnings, are explained by the console, or by
    `GET /v1/robots/ROBOT/preflight`.

    aerodaas fleet --at https://provider.example
    aerodaas fleet --json | jq '.robots[] | select(.lease == null) | .id'
    """
    found = client_at(at).fleet()
    if as_json:
        print_json(found)
        return
    rows = [
        (
            one.id,
            _use(one.enabled, one.lease, one.mission, one.tenant),
            "-" if one.battery is None else f"{one.battery:.0%}",
            _place(one.position),
            "-" if one.preflight is None else _READY[one.preflight.value],
            _health(one),
            ", ".join(sensor.rpartition("/")[2] for sensor in one.sensors),
        )
        for one in found.robots
    ]
    print_table(
        found.name, ("robot", "use", "battery", "where", "take-off", "health", "sensors"), rows
    )


def submit(
    context: typer.Context,
    application: Annotated[
        Path, typer.Argument(help="The application: a Python file, or a mission document.")
    ],
    to: Annotated[
        str | None,
        typer.Option(
            "--to",
            metavar="URL",
            envvar="AERODAAS_PROVIDER",
            help="The provider. Default: the only one that you are logged in at.",
        ),
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(min=0.1, help="For which its drones are leased. Default: 15."),
    ] = None,
    lease: Annotated[
        str | None, typer.Option(help="A lease that you have, instead of a new one.")
    ] = None,
    silence: Annotated[
        str | None,
        typer.Option(help="If your connection is lost: `continue` (default) or `return`."),
    ] = None,
    silence_seconds: Annotated[
        float | None, typer.Option(min=1, help="After how long. Default: 30.")
    ] = None,
    share: Annotated[list[str] | None, typer.Option(help="A tenant that may watch, too.")] = None,
    grant: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TENANT[=SENSOR,…]", help="A tenant that may attach missions to its cameras."
        ),
    ] = None,
    attach: Annotated[
        str | None,
        typer.Option(metavar="MISSION", help="Sense only, by the cameras of a mission in flight."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the simulation, if the drones are.")
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(help="Where recording, plots and summary go. Default: a folder in runs/."),
    ] = None,
    wait: Annotated[  # noqa: FBT002
        bool,
        typer.Option(
            "--wait/--no-wait",
            help="Watch the flight and fetch its recording. Without it, the application runs up "
            "to start_mission() only, and what is code of its own cannot fly.",
        ),
    ] = True,
    view: Annotated[bool, typer.Option(help="Show the flight in the terminal.")] = True,  # noqa: FBT002
    as_json: Json = False,  # noqa: FBT002
) -> None:
    """Fly an application on a provider's drones, unchanged but for the address.

    Ctrl-C has the provider bring the drones home. Words after `--` are the application's own.

        aerodaas submit farm_survey --to https://provider.example
        aerodaas submit farm.json --minutes 5 --silence return
        aerodaas submit my_app.py --no-wait --json | jq -r .id
        aerodaas submit crowd_watch --attach 3f1a6c0d9b2e
    """
    from aerodaas.environment.provider.logins import default_url  # noqa: PLC0415 - slow to load

    if silence not in {None, "continue", "return"}:
        raise ConfigError(f"--silence is continue or return, not {silence!r}")
    application = find_application(application)
    wanted = ProviderOptions(
        url=to or default_url(),
        minutes=minutes,
        lease=lease,
        silence=silence,
        silence_seconds=silence_seconds,
        share=tuple(share or ()),
        grant=tuple(grant or ()),
        attach=attach,
        report=print_json if as_json else None,
    )
    options = RunOptions(
        provider=wanted,
        seed=seed,
        record=record,
        view=view and not as_json,
        application=application.resolve(),
    )
    if wait:
        run_application(application, context.args, options)
        return
    mission = submit_application(application, context.args, options)
    if as_json:
        print_json(mission)
    else:
        typer.echo(f"{mission.id} is submitted; aerodaas missions watch {mission.id} follows it")


def _missing_token() -> str:
    raise ConfigError("no token was given: type it, or pipe it in")


def _use(enabled: bool, lease: str | None, mission: str | None, tenant: str | None) -> str:  # noqa: FBT001
    if not enabled:
        return "out of service"
    if lease is None:
        return "free"
    return f"flies {mission}" if mission else f"leased by {tenant}" if tenant else "leased"


def _health(robot: RobotOut) -> str:
    """The link, and what speaks against a flight; of a drone in flight, its complaints."""
    said = robot.objection or "; ".join(robot.faults)
    if robot.link.value == "lost":
        return said or "does not answer"
    return f"{robot.link.value}: {said}" if said else robot.link.value


def _place(position: tuple[float, float, float] | None) -> str:
    if position is None:
        return "-"
    east, north, up = (round(axis, 1) + 0.0 for axis in position)
    return f"E {east:.1f}  N {north:.1f}  up {up:.1f} m"
