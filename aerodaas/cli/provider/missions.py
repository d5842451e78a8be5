"""`aerodaas missions`: missions at a provider."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.options import ExampleGroup
from aerodaas.cli.provider.provider import (
    At,
    Json,
    client_at,
    moment,
    print_json,
    print_table,
)
from aerodaas.errors import ConfigError, MissionError
from aerodaas.protocol.proposals import ApprovalIn
from aerodaas.protocol.schemas import MissionOut
from aerodaas.text.printable import printable

__all__ = ["app"]

_LOOK_SECONDS = 0.5
MissionId = Annotated[
    str, typer.Argument(metavar="MISSION", help="Its id; `missions list` tells it.")
]

app = typer.Typer(
    cls=ExampleGroup,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""List, watch, approve and cancel missions at a provider, grant cameras, fetch recordings.

`aerodaas submit` begins one.

    aerodaas missions list
    aerodaas missions watch 3f1a6c0d9b2e
    aerodaas missions fetch 3f1a6c0d9b2e -o flight.mcap
""",
)


@app.command("list")
def list_missions(at: At = None, as_json: Json = False) -> None:  # noqa: FBT002
    """List the missions that you may see, newest first.

    aerodaas missions list
    aerodaas missions list --json | jq -r '.[] | select(.phase == "flying") | .id'
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


@app.command()
def watch(mission: MissionId, at: At = None, as_json: Json = False) -> None:  # noqa: FBT002
    """Watch a mission until it is over; Ctrl-C leaves it as it is.

    Ends with 1 if the mission was refused, cancelled or failed.

        aerodaas missions watch 3f1a6c0d9b2e
        aerodaas missions watch 3f1a6c0d9b2e --json | jq -c .status
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
        typer.echo(f"landed; aerodaas missions fetch {found.id} brings the recording")


@app.command()
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

    aerodaas missions grant 3f1a6c0d9b2e city one/cam
    aerodaas missions grant 3f1a6c0d9b2e city --withdraw
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


@app.command()
def approve(
    mission: MissionId,
    actuators: Annotated[
        list[str] | None,
        typer.Option("--actuator", metavar="ROBOT/ACTUATOR", help="One that it may move."),
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,  # noqa: FBT002
    at: At = None,
    as_json: Json = False,  # noqa: FBT002
) -> None:
    """Approve a mission that waits for it, after a look at what would fly.

    A proposal is approved exactly as it is shown; another rehearsal makes it another one.

        aerodaas missions approve 3f1a6c0d9b2e
        aerodaas missions approve 3f1a6c0d9b2e --actuator quadrotor_base/hook
    """
    client = client_at(at)
    found = client.mission(mission)
    for line in _told_to_approver(found):
        typer.echo(line, err=as_json)
    if not (yes or typer.confirm("Approve it?", err=as_json)):
        raise MissionError(f"{mission} was not approved")
    approval = None
    if found.proposal is not None:
        approval = ApprovalIn(hash=found.proposal.hash, actuators=actuators or [])
    found = client.approve(mission, approval)
    if as_json:
        print_json(found)
    else:
        typer.echo(f"{found.id}: {found.phase.value}: {found.reason}")


def _told_to_approver(mission: MissionOut) -> Iterator[str]:
    """Describe a mission to its approver, a line each; a stranger's words are marked."""
    yield f"{mission.id} of {mission.account} ({mission.tenant}): {', '.join(mission.robots)}"
    if (proposal := mission.proposal) is not None:
        yield from (f"  {line}" for line in (*proposal.summary, *proposal.records))
        yield from (f"  moves the actuator {name}" for name in proposal.actuators)
        yield from (f"  {line}" for line in proposal.difference)
        if proposal.why:
            yield f"  its proposer says, and nobody has checked: {printable(proposal.why)!r}"
    if (verdict := mission.verdict) is None:
        yield "  not rehearsed"
        return
    figures = [
        f"{value:{form}} {unit}"
        for value, form, unit in (
            (verdict.seconds, ".0f", "s"),
            (verdict.distance, ".0f", "m"),
            (verdict.battery_used, ".0%", "of the charge"),
        )
        if value is not None
    ]
    word = "good" if verdict.approved else "not good"
    yield f"  rehearsal: {word}; {', '.join(figures)}"
    if (clearance := verdict.clearance) is not None:
        place = ", ".join(f"{axis:.1f}" for axis in clearance.place)
        yield f"  nearest object: {clearance.distance:.1f} m, {clearance.label}, at ({place})"


@app.command()
def cancel(mission: MissionId, at: At = None, as_json: Json = False) -> None:  # noqa: FBT002
    """Cancel a mission; drones in flight come home and land.

    aerodaas missions cancel 3f1a6c0d9b2e
    """
    found = client_at(at).cancel(mission)
    if as_json:
        print_json(found)
    elif found.phase.over:
        typer.echo(f"{found.id} is cancelled")
    else:
        follows = f"aerodaas missions watch {found.id} follows them"
        typer.echo(f"{found.id}: the drones come home; {follows}")


@app.command()
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

    aerodaas missions fetch 3f1a6c0d9b2e -o flight.mcap
    aerodaas missions fetch 3f1a6c0d9b2e --delete
    aerodaas report flight.mcap
    """
    from aerodaas.terminal.progress import download_view  # noqa: PLC0415 - slow to load

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
