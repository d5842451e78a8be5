"""`aerodaas remote`: take part in a mission that is flying."""

from __future__ import annotations

import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodaas.analytics.remote import TOKEN_VARIABLE
from aerodaas.cli.options import ExampleGroup
from aerodaas.clock import seconds

if TYPE_CHECKING:
    from aerodaas.environment.remote_client import RemoteClient
    from aerodaas.messages.mission import RobotStatus

__all__ = ["app"]

app = typer.Typer(
    cls=ExampleGroup,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help=f"""Take part in a mission that is flying.

The application must use `RemoteAnalytics`. The token, if there is one, comes from the environment
variable {TOKEN_VARIABLE} or from the environment file.

    aerodaas remote status --follow
    aerodaas remote add-waypoint 10 -5 2 --hover 3
    aerodaas remote --env apps/environments/farm.json pause
""",
)


@app.callback()
def connect(
    context: typer.Context,
    url: Annotated[
        str | None,
        typer.Option(envvar="AERODAAS_REMOTE_URL", help="Default: http://127.0.0.1:8350."),
    ] = None,
    env: Annotated[
        Path | None, typer.Option(help="Environment file that tells address and token.")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="Default: the only one that flies.")] = None,
    token: Annotated[
        str | None, typer.Option(envvar=TOKEN_VARIABLE, hidden=True, show_envvar=False)
    ] = None,
) -> None:
    """Know whom to speak to."""
    from aerodaas.config.model import EnvironmentConfig, RemoteConfig  # noqa: PLC0415 - slow to load
    from aerodaas.environment.remote_client import RemoteClient  # noqa: PLC0415 - as above

    settings = EnvironmentConfig.load(env).remote if env else RemoteConfig()
    secret = settings.token.get_secret_value() if settings.token else None
    host = f"[{settings.host}]" if ":" in settings.host else settings.host
    context.obj = RemoteClient(url or f"http://{host}:{settings.port}", token or secret, robot)


@app.command("add-waypoint", context_settings={"ignore_unknown_options": True})
def add_waypoint(
    context: typer.Context,
    x: Annotated[float, typer.Argument(help="Metres east, or latitude.")],
    y: Annotated[float, typer.Argument(help="Metres north, or longitude.")],
    z: Annotated[float, typer.Argument(help="Metres up, or altitude.")],
    name: Annotated[str | None, typer.Option("--id", help="Default: a fresh one.")] = None,
    hover: Annotated[float, typer.Option(help="Seconds to stay there.")] = 0.0,
    kind: Annotated[
        str,
        typer.Option(
            "--type",
            help="relative (to take-off), local (to home), global, or "
            "global_relative (a place on the globe, metres above home).",
        ),
    ] = "relative",
    above: Annotated[
        str | None,
        typer.Option(help="What Z is counted from: home, sea or ground. Default: as --type says."),
    ] = None,
    speed: Annotated[float | None, typer.Option(help="m/s on the way there.")] = None,
    priority: Annotated[int, typer.Option(help="Smaller is more urgent and preempts.")] = 5,
    deadline: Annotated[float | None, typer.Option(help="Seconds of mission time.")] = None,
    index: Annotated[int | None, typer.Option(help="Waypoints to visit before.")] = None,
) -> None:
    """Add a waypoint to the plan.

    The trajectory scheduler says when it is visited, unless an index or a priority does.

        aerodaas remote add-waypoint 10 -5 2
        aerodaas remote add-waypoint 10 -5 2 --id tree --hover 5 --priority 1
        aerodaas remote add-waypoint 13.0166 77.5695 930 --type global
    """
    waypoint: dict[str, Any] = {
        "id": name or f"remote-{uuid.uuid4().hex[:4]}",
        "x": x,
        "y": y,
        "z": z,
        "hover_duration": hover,
        "waypoint_type": kind,
        "speed": speed,
        "priority": priority,
        "deadline": deadline,
        **({"above": above} if above else {}),
    }
    _client(context).add_waypoints([waypoint], index=index)
    typer.echo(f"{waypoint['id']} is on the plan")


@app.command()
def pause(context: typer.Context) -> None:
    """Hover until told to resume."""
    _say(context, "pause", "the drone hovers")


@app.command()
def resume(context: typer.Context) -> None:
    """Go on where the mission was paused."""
    _say(context, "resume", "the mission goes on")


@app.command()
def clear(context: typer.Context) -> None:
    """Empty the plan, hover, and wait for new waypoints."""
    _say(context, "clear", "the plan is empty")


@app.command("return-home")
def return_home(context: typer.Context) -> None:
    """Fly back to the place of take-off and land."""
    _say(context, "return-home", "the drone comes home")


@app.command()
def abort(context: typer.Context) -> None:
    """Land at once, where the drone is."""
    _say(context, "land", "the drone lands")


@app.command()
def status(
    context: typer.Context,
    follow: Annotated[bool, typer.Option("--follow", help="Until the mission is over.")] = False,  # noqa: FBT002
    rate: Annotated[float, typer.Option(help="Lines per second.")] = 1.0,
    as_json: Annotated[bool, typer.Option("--json", help="For programs.")] = False,  # noqa: FBT002
) -> None:
    """Say how the mission fares.

    One line: mission time, state, place, battery, progress, and the reason for the state.

        aerodaas remote status
        aerodaas remote status --follow --json | jq .vehicle.odometry.position
    """
    from aerodaas.messages.serialization.schema import json_text  # noqa: PLC0415 - slow to load

    client = _client(context)
    for one in client.stream(rate) if follow else [client.status()]:
        typer.echo(json_text(one) if as_json else _line(one))


def _client(context: typer.Context) -> RemoteClient:
    client: RemoteClient = context.obj
    return client


def _say(context: typer.Context, command: str, done: str) -> None:
    _client(context).command(command)
    typer.echo(done)


def _line(status: RobotStatus) -> str:
    from aerodaas.terminal.panels import place_text  # noqa: PLC0415 - slow to load

    mission = status.mission
    visited, known = mission.waypoint_counts
    parts = [f"{seconds(mission.stamp):7.1f} s", mission.state.value]
    if status.vehicle is not None:
        parts.append(place_text(status.vehicle))
    if status.charge is not None:
        parts.append(f"battery {status.charge:.0%}")
    if known:
        parts.append(f"{visited} of {known} waypoints")
    return "  ".join([*parts, *(text for text in (mission.reason, *mission.faults) if text)])
