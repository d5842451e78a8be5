"""Commands at a provider's service: its fleet, missions on it, and leases."""

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
from aerodaas.errors import ConfigError, MissionError

if TYPE_CHECKING:
    from pydantic import BaseModel

    from aerodaas.environment.provider.client import ProviderClient
    from aerodaas.protocol.schemas import RobotOut

__all__ = [
    "At",
    "Json",
    "cancel",
    "client_at",
    "fetch",
    "fleet",
    "grant",
    "login",
    "missions",
    "moment",
    "print_json",
    "print_table",
    "submit",
    "watch",
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


_LOOK_SECONDS = 0.5
_READY = {"good": "ready", "warning": "warned", "refused": "refused"}
"""What the list before take-off says, by the gravest of its items."""
MissionId = Annotated[str, typer.Argument(metavar="MISSION", help="Its id; `missions` lists them.")]


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
        typer.echo(f"{mission.id} is submitted; aerodaas watch {mission.id} follows it")


def missions(at: At = None, as_json: Json = False) -> None:  # noqa: FBT002
    """List the missions that you may see, newest first.

    aerodaas missions
    aerodaas missions --json | jq -r '.[] | select(.phase == "flying") | .id'
    """
    found = client_at(at).missions()
    if as_json:
        print_json(found)
        return
    rows = [
        (
            one.id,
            one.name,
            one.phase.value.replace("_", " "),
            ", ".join(one.robots),
            one.account,
            moment(one.submitted),
            one.reason,
        )
        for one in found
    ]
    print_table("missions", ("id", "name", "phase", "robots", "of", "submitted", "reason"), rows)


def watch(mission: MissionId, at: At = None, as_json: Json = False) -> None:  # noqa: FBT002
    """Watch a mission until it is over; Ctrl-C leaves it as it is.

    Ends with 1 if the mission was refused, cancelled or failed.

        aerodaas watch 3f1a6c0d9b2e
        aerodaas watch 3f1a6c0d9b2e --json | jq -c .status
    """
    from aerodaas.environment.provider.follower import MissionFollower  # noqa: PLC0415 - slow
    from aerodaas.terminal.provided import ProvidedView  # noqa: PLC0415 - slow to load

    client = client_at(at)
    found = client.mission(mission)
    with ProvidedView(shown=not as_json) as view:
        follower = MissionFollower(client, found, view.show_message)
        follower.start()
        seen = -1
        while True:
            if not as_json:
                # Again without a change: it shows how old that is.
                view.update(found)
            elif seen < follower.changes:
                typer.echo(found.model_dump_json())
            seen = follower.changes
            if found.phase.over:
                break
            found = follower.await_change(seen, _LOOK_SECONDS)
    if found.phase.value != "landed":
        raise MissionError(f"mission {found.id} {found.phase.value}: {found.reason}")
    if not as_json:
        typer.echo(f"landed; aerodaas fetch {found.id} brings the recording")


def grant(
    mission: MissionId,
    tenant: Annotated[str, typer.Argument(help="Who may attach missions that sense only.")],
    sensors: Annotated[
        list[str] | None, typer.Argument(metavar="[SENSOR]…", help="Cameras. Default: all.")
    ] = None,
    withdraw: Annotated[  # noqa: FBT002
        bool, typer.Option("--withdraw", help="Withdraw it: what is attached ends.")
    ] = False,
    at: At = None,
    as_json: Json = False,  # noqa: FBT002
) -> None:
    """Share the cameras of your mission in flight with another tenant's applications.

    aerodaas grant 3f1a6c0d9b2e city one/cam
    aerodaas grant 3f1a6c0d9b2e city --withdraw
    """
    client = client_at(at)
    if withdraw:
        found = client.withdraw(mission, tenant)
    else:
        found = client.grant(mission, tenant, sensors or ())
    if as_json:
        print_json(found)
        return
    granted = [f"{name} ({', '.join(one) or 'all cameras'})" for name, one in found.grants.items()]
    typer.echo(f"{found.id} shares its cameras with {'; '.join(granted) or 'nobody'}")


def cancel(mission: MissionId, at: At = None, as_json: Json = False) -> None:  # noqa: FBT002
    """Cancel a mission; drones in flight come home and land.

    aerodaas cancel 3f1a6c0d9b2e
    """
    found = client_at(at).cancel(mission)
    if as_json:
        print_json(found)
    elif found.phase.over:
        typer.echo(f"{found.id} is cancelled")
    else:
        typer.echo(f"{found.id}: the drones come home; aerodaas watch {found.id} follows them")


def fetch(
    mission: MissionId,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The file. Default: MISSION.mcap."),
    ] = None,
    delete: Annotated[  # noqa: FBT002
        bool, typer.Option("--delete", help="Remove it at the provider once it is here.")
    ] = False,
    at: At = None,
    as_json: Json = False,  # noqa: FBT002
) -> None:
    """Fetch the recording of a mission that is over.

    aerodaas fetch 3f1a6c0d9b2e -o flight.mcap
    aerodaas fetch 3f1a6c0d9b2e --delete
    aerodaas report flight.mcap
    """
    from aerodaas.terminal.provided import download_view  # noqa: PLC0415 - slow to load

    client = client_at(at)
    target = output or Path(f"{Path(mission).name}.mcap")
    if target.exists():
        raise ConfigError(f"{target} already exists and is not overwritten; name another file")
    try:
        with download_view(shown=not as_json, what=target.name) as progress:
            client.recording(mission, target, progress)
    except OSError as error:
        raise ConfigError(f"cannot write {target}: {error.strerror}") from None
    if delete:
        client.delete_recording(mission)
    size = target.stat().st_size
    if as_json:
        typer.echo(json.dumps({"mission": mission, "file": str(target), "bytes": size}))
    else:
        typer.echo(f"{target}: {size / 1e6:.1f} MB")


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
