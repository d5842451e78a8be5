"""`aerodaas lease`: drones of a provider for a time."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated

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

if TYPE_CHECKING:
    from aerodaas.environment.provider.client import ProviderClient
    from aerodaas.protocol.schemas import LeaseOut

__all__ = ["app"]

_LOOK_SECONDS = 0.5
LeaseId = Annotated[str, typer.Argument(metavar="LEASE", help="Its id; `lease list` tells it.")]

app = typer.Typer(
    cls=ExampleGroup,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Lease a provider's drones: while a lease lasts, its tenant alone flies them.

A mission that is submitted without a lease asks for its own.

    aerodaas lease ask one --minutes 30 --wait
    aerodaas submit apps/farm_survey.py --lease 33b5a1c07d2e
    aerodaas lease give-back 33b5a1c07d2e
""",
)


@app.command()
def ask(
    robots: Annotated[
        list[str] | None, typer.Argument(metavar="[ROBOT]...", help="Default: any that fits.")
    ] = None,
    minutes: Annotated[float, typer.Option(help="How long.")] = 15.0,
    camera: Annotated[bool, typer.Option("--camera", help="Any one with a camera.")] = False,  # noqa: FBT002
    within: Annotated[
        float | None, typer.Option(metavar="METRES", help="Any one so near to --near.")
    ] = None,
    near: Annotated[
        str, typer.Option(metavar="EAST,NORTH", help="Metres of the provider's home.")
    ] = "0,0",
    battery_minutes: Annotated[
        float | None, typer.Option(help="Any one whose charge lasts so long.")
    ] = None,
    area: Annotated[
        str | None,
        typer.Option(
            metavar="CORNERS",
            help="Where it will stay, which narrows the fence: EAST,NORTH of each corner.",
        ),
    ] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Until it is granted.")] = False,  # noqa: FBT002
    at: At = None,
    as_json: Json = False,  # noqa: FBT002
) -> None:
    """Ask for drones: granted at once if they are free, else queued.

    Ctrl-C while waiting leaves the lease queued.

        aerodaas lease ask one two --minutes 30
        aerodaas lease ask --camera --within 500 --near 120,-40 --battery-minutes 10
        aerodaas lease ask one --area '0,0 40,0 40,30 0,30' --wait --json | jq -r .id
    """
    from aerodaas.config.checked import checked  # noqa: PLC0415 - slow to load
    from aerodaas.protocol.schemas import LeaseIn  # noqa: PLC0415 - as above

    wanted = {
        "robots": robots or None,
        "minutes": minutes,
        "camera": camera,
        "within": within,
        "near": _place(near),
        "battery_minutes": battery_minutes,
        "area": None if area is None else [_place(corner) for corner in area.split()],
    }
    client = client_at(at)
    found = client.request_lease(checked(LeaseIn, wanted, "the lease"))
    if wait:
        found = _granted(client, found)
    _print_lease(found, as_json=as_json)


@app.command("list")
def list_leases(at: At = None, as_json: Json = False) -> None:  # noqa: FBT002
    """List the leases that you may see, in the queue's order.

    aerodaas lease list
    aerodaas lease list --json | jq -r '.[] | select(.state == "queued") | .id'
    """
    found = client_at(at).leases()
    if as_json:
        print_json(found)
        return
    rows = [
        (
            one.id,
            one.state.value,
            _robots(one),
            f"{one.account} of {one.tenant}",
            f"{one.minutes:g} min",
            "-" if one.ends is None else moment(one.ends),
            one.reason,
        )
        for one in found
    ]
    print_table("leases", ("id", "state", "robots", "of", "for", "ends", "reason"), rows)


@app.command()
def extend(
    lease: LeaseId,
    minutes: Annotated[float, typer.Argument(help="How much later it is to end.")],
    at: At = None,
    as_json: Json = False,  # noqa: FBT002
) -> None:
    """Have a granted lease end later, if nobody waits for its drones.

    aerodaas lease extend 33b5a1c07d2e 10
    """
    _print_lease(client_at(at).extend_lease(lease, minutes), as_json=as_json)


@app.command("give-back")
def give_back(lease: LeaseId, at: At = None, as_json: Json = False) -> None:  # noqa: FBT002
    """Give a lease back, or revoke another tenant's as an operator; its drones come home.

    aerodaas lease give-back 33b5a1c07d2e
    """
    _print_lease(client_at(at).end_lease(lease), as_json=as_json)


def _granted(client: ProviderClient, lease: LeaseOut) -> LeaseOut:
    """The lease once it is granted; raises MissionError if it ends before."""
    while lease.state.value == "queued":
        time.sleep(_LOOK_SECONDS)
        lease = client.lease(lease.id)
    if lease.state.value == "ended":
        raise MissionError(f"the lease {lease.id} has ended: {lease.reason}")
    return lease


def _print_lease(lease: LeaseOut, *, as_json: bool) -> None:
    if as_json:
        print_json(lease)
        return
    whose = f"{lease.id}: {_robots(lease)}"
    if lease.state.value == "ended":
        typer.echo(f"{whose}: ended, {lease.reason}")
    elif lease.ends is None:
        typer.echo(
            f"{whose}: queued for {lease.minutes:g} min; aerodaas lease list shows the queue"
        )
    else:
        typer.echo(f"{whose}: granted until {moment(lease.ends)}")


def _robots(lease: LeaseOut) -> str:
    return ", ".join(lease.robots) or "any that fits"


def _place(text: str) -> tuple[float, float]:
    try:
        east, north = map(float, text.split(","))
    except ValueError:
        raise ConfigError(
            f"a place is EAST,NORTH in metres, such as 120,-40, not {text!r}"
        ) from None
    return east, north
