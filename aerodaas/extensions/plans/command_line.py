"""`aerodaas plan`: what ground stations' plans hold, and what of it is flown."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerodaas.cli.options import ExampleGroup
from aerodaas.errors import ConfigError
from aerodaas.extensions.payload.actions import (
    AimGimbal,
    LookAt,
    RecordVideo,
    TakePhoto,
    TriggerPhotos,
)
from aerodaas.messages.actions import action_kinds
from aerodaas.text.printable import printable

if TYPE_CHECKING:
    from aerodaas.geometry.frames import GeodeticOrigin
    from aerodaas.messages.waypoints import Waypoint

__all__ = ["app"]

File = Annotated[Path, typer.Argument(metavar="PLAN", help="A .plan or .waypoints file.")]
HomeAltitude = Annotated[
    float | None,
    typer.Option(help="Metres above the sea of the environment's home. Default: the plan's own."),
]

app = typer.Typer(
    cls=ExampleGroup,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""Read the plans of QGroundControl and Mission Planner.

    aerodaas plan show survey.plan
    aerodaas plan fence survey.plan --home 47.3977,8.5456
""",
)


@app.command()
def show(plan: File, home_altitude: HomeAltitude = None) -> None:
    """List the waypoints that would be flown, and what the plan means and is not done.

    aerodaas plan show survey.plan
    """
    from aerodaas.extensions.plans.navigation import flown_plan  # noqa: PLC0415 - slow to load
    from aerodaas.messages.waypoints import HeightReference  # noqa: PLC0415

    waypoints, notices = flown_plan(plan, home_altitude)
    for one in waypoints:
        above = HeightReference(one.above or HeightReference.HOME).value
        place = f"{one.id:>8}  {one.x:.7f}, {one.y:.7f}, {one.z:g} m above {above}"
        typer.echo(f"{place}{_flown(one)}{_pictures(one)}")
    for notice in notices:
        typer.echo(printable(f"not done: {notice}"))
    typer.echo(f"{plan}: waypoints: {len(waypoints)}, not done: {len(notices)}")


def _flown(waypoint: Waypoint) -> str:
    from aerodaas.geometry.frames import yaw_enu_to_ned  # noqa: PLC0415 - loads numpy

    said = [] if waypoint.speed is None else [f", {waypoint.speed:g} m/s"]
    if waypoint.hover_duration:
        said.append(f", hovers {waypoint.hover_duration:g} s")
    if waypoint.yaw is not None:
        said.append(f", heading {math.degrees(yaw_enu_to_ned(waypoint.yaw)) % 360:.0f} degrees")
    return "".join(said)


def _pictures(waypoint: Waypoint) -> str:
    said = []
    order = list(action_kinds())
    for action in sorted(waypoint.actions, key=lambda action: order.index(action.type)):
        match action:
            case TriggerPhotos(distance=None, interval=interval):
                said.append(f", a picture every {interval:g} s on the way")
            case TriggerPhotos(distance=distance):
                said.append(f", a picture every {distance:g} m on the way")
            case LookAt(x=x, y=y, z=z):
                said.append(f", looks at {x:.7f}, {y:.7f}, {z:g} m")
            case AimGimbal(pitch=pitch, yaw=yaw):
                pitch, yaw = math.degrees(pitch), math.degrees(yaw)
                said.append(f", gimbal at pitch {pitch:.0f}, yaw {yaw:.0f} degrees")
            case TakePhoto():
                said.append(", a picture")
            case RecordVideo(on=on):
                said.append(f", video {'begins' if on else 'ends'}")
    return "".join(said)


@app.command()
def fence(
    plan: File,
    home: Annotated[
        str | None,
        typer.Option(metavar="LAT,LON", help="The environment's home. Default: the plan's own."),
    ] = None,
) -> None:
    """Print a plan's geofence as a robot's `limits.geofence` of an environment file.

    aerodaas plan fence survey.plan --home 47.3977,8.5456
    """
    from aerodaas.extensions.plans.fences import geofence_of  # noqa: PLC0415 - slow to load
    from aerodaas.extensions.plans.navigation import read_plan  # noqa: PLC0415
    from aerodaas.geometry.frames import GeodeticOrigin  # noqa: PLC0415

    read = read_plan(plan)
    if not read.fence:
        raise ConfigError(f"{plan} has no geofence; draw one in QGroundControl")
    if home is not None:
        origin = _home(home)
    elif read.home is not None:
        origin = GeodeticOrigin(read.home.latitude, read.home.longitude)
    else:
        raise ConfigError(f"{plan} does not know its home: give --home LAT,LON")
    content = geofence_of(read.fence, origin).model_dump(include={"polygon", "no_fly"})
    typer.echo(json.dumps(content, indent=2))


def _home(text: str) -> GeodeticOrigin:
    from aerodaas.extensions.plans.formats.numbers import place  # noqa: PLC0415 - as above
    from aerodaas.geometry.frames import GeodeticOrigin  # noqa: PLC0415

    try:
        latitude, longitude = (float(one) for one in text.split(","))
    except ValueError:
        raise ConfigError(f"--home must be LAT,LON in degrees, not {text!r}") from None
    return GeodeticOrigin(*place(latitude, longitude, "--home"))
