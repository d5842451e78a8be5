"""`aerodaas init`: an environment file, by questions, by options, or by discovery."""

from __future__ import annotations

import json
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import typer

from aerodaas.config.environment_choices import (
    EnvironmentChoices,
    camera_words,
    default_address,
    vehicle_kinds,
)
from aerodaas.config.extensions import VehicleDiscovery, imported
from aerodaas.errors import ConfigError

__all__ = ["init"]

_SCHEMA = "environment.schema.json"
_NUMBERS = re.compile(r"\[\n\s*(-?[\d.]+(?:,\n\s*-?[\d.]+)*)\n\s*\]")
"""A list of numbers over several lines, as no string of JSON holds a line's end."""


def init(
    *,
    vehicle: Annotated[
        str | None,
        typer.Option("--vehicle", "-v", help=f"`{'`, `'.join(vehicle_kinds())}`."),
    ] = None,
    url: Annotated[
        str | None,
        typer.Option(
            help="Where it is: a MAVLink URL such as `udpin:127.0.0.1:14540` or "
            "`serial:/dev/ttyACM0:57600`, or a network address."
        ),
    ] = None,
    camera: Annotated[
        list[str] | None,
        typer.Option(
            "--camera",
            "-c",
            help="A device (`/dev/video0`), a URL (`rtsp://…`), a file or a folder of pictures, "
            "or the vehicle's own by its name, or `none`; may be given several times. Default: the "
            "one that the vehicle brings along.",
        ),
    ] = None,
    discover: Annotated[
        bool,
        typer.Option(
            "--discover",
            help="Listen for vehicles and look for video devices; nothing is sent off this "
            "machine.",
        ),
    ] = False,
    ask: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="With --discover, also ask this address whether a vehicle is there, such as a "
            "Tello at 192.168.10.1. Nothing moves.",
        ),
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=0.1, max=60, help="How long --discover listens.")
    ] = 3.0,
    output: Annotated[Path, typer.Option("--output", "-o", help="The file.")] = Path(
        "environment.json"
    ),
    force: Annotated[
        bool, typer.Option("--force", help="Write over a file that is there.")
    ] = False,
) -> None:
    """Write an environment file, and beside it the schema by which editors explain it.

    Without options it asks. `aerodaas check environment.json` then tries what the file names.

        aerodaas init
        aerodaas init --vehicle px4 --camera rtsp://127.0.0.1:8554/front
        aerodaas init --discover
    """
    _require_free(output, force=force)
    if not discover and ask is not None:
        raise ConfigError("--ask goes with --discover")
    if discover:
        beginning = _discovered(vehicle, url, camera, ask, seconds)
    elif vehicle is None:
        if url is not None or camera:
            raise ConfigError(f"name the vehicle, too: {_choices()}")
        beginning = _asked()
    else:
        beginning = EnvironmentChoices(vehicle, url, cameras=camera)
    _write(beginning, output, force=force)


def _choices() -> str:
    """The option that names a vehicle, with what it may be."""
    return f"--vehicle {' | '.join(vehicle_kinds())}"


def _require_free(output: Path, *, force: bool) -> None:
    """Refuse a file that is there before anything is asked."""
    if output.exists() and not force:
        raise ConfigError(f"{output} is there already: --force writes over it, --output elsewhere")


def _asked() -> EnvironmentChoices:
    from aerodaas.cameras.devices import video_devices  # noqa: PLC0415 - only where it is asked

    kinds = tuple(vehicle_kinds())
    try:
        vehicle = typer.prompt(f"Which vehicle: {', '.join(kinds)}?", kinds[0])
        while vehicle not in kinds:
            vehicle = typer.prompt("One of these", kinds[0])
        address = default_address(vehicle)
        if address is not None:
            address = typer.prompt("Where is it?", address)
        devices = video_devices()[0]
        for device in devices:
            typer.echo(f"  {device.path} is there: {device.name}")
        usual = ", ".join(camera_words(vehicle)) or "none"
        text = "Which cameras? A device, a URL, a file or a folder; several by commas"
        cameras = [word.strip() for word in typer.prompt(text, usual).split(",")]
    except typer.Abort:
        raise ConfigError(
            f"there is no terminal to ask: give {_choices()}, or --discover"
        ) from None
    return EnvironmentChoices(vehicle, address, cameras=cameras)


def _discovered(
    vehicle: str | None,
    url: str | None,
    cameras: list[str] | None,
    asked: str | None,
    seconds: float,
) -> EnvironmentChoices:
    """Choices by options first, then by discovery, which is printed."""
    from aerodaas.cameras.devices import video_devices  # noqa: PLC0415 - only where it is asked
    from aerodaas.drivers.mavlink.discovery import hear_vehicles  # noqa: PLC0415 - slow to load

    typer.echo(f"listening for {seconds:g} s")
    searched = [kind for kind in vehicle_kinds().values() if kind.find]
    with ThreadPoolExecutor(max(1, len(searched))) as threads:
        searches = [threads.submit(imported(kind.find), seconds, asked) for kind in searched]
        heard = hear_vehicles(seconds)
        discoveries: list[VehicleDiscovery] = [search.result() for search in searches]
    devices, notes = video_devices()
    found = [EnvironmentChoices(one.family, one.url, one.system) for one in heard.vehicles]
    told = [one.text for one in heard.vehicles]
    for kind, discovery in zip(searched, discoveries, strict=True):
        if discovery.address is not None:
            found.append(EnvironmentChoices(kind.name, discovery.address))
            told.append(f"{kind.name} at {discovery.address}")
    hints = [note for discovery in discoveries for note in discovery.notes]
    for line in [*told, *(f"camera {one.path}: {one.name}" for one in devices)]:
        typer.echo(f"  found: {line}")
    for line in (*heard.notes, *hints, *notes):
        typer.echo(f"  {line}")
    fitting = [one for one in found if vehicle in {None, one.vehicle}]
    if vehicle is None and not fitting:
        raise ConfigError(f"no vehicle was found: switch it on and try again, or give {_choices()}")
    chosen = fitting[0] if fitting else EnvironmentChoices(vehicle or "")
    if len(fitting) > 1:
        typer.echo("  written is the first; another one by --vehicle and --url")
    alone = [one.address for one in found].count(chosen.address) == 1
    if cameras is None:
        cameras = [*camera_words(chosen.vehicle), *(one.path for one in devices)] or None
    return EnvironmentChoices(
        chosen.vehicle, url or chosen.address, None if alone or url else chosen.system, cameras
    )


def _write(beginning: EnvironmentChoices, output: Path, *, force: bool) -> None:
    from aerodaas.config.model import validated  # noqa: PLC0415 - slow to load
    from aerodaas.config.schema import environment_schema  # noqa: PLC0415 - slow to load
    from aerodaas.runtime.checks import check_environment  # noqa: PLC0415 - slow to load

    document = beginning.document(_SCHEMA, output.parent)
    check_environment(validated(document, str(output)), str(output))
    schema = output.parent / _SCHEMA
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        with output.open("w" if force else "x", encoding="utf-8") as file:
            file.write(_text(document))
        if force or not schema.exists():
            schema.write_text(environment_schema(), encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {output}: {error.strerror}") from None
    (robot,) = document["robots"]
    fence = robot["limits"]["geofence"]
    cameras = [one["id"] for one in robot["sensors"] if one["type"] == "camera"]
    typer.echo(
        f"{output}: {beginning.vehicle}, cameras: {', '.join(cameras) or 'none'}; kept within "
        f"{fence['polygon'][1][0]} m of the take-off to each side and below {fence['ceiling']} m "
        "(limits.geofence)"
    )
    typer.echo(f"next: aerodaas check {output}")


def _text(document: object) -> str:
    """JSON with lists of numbers on one line each, such as the corners of a fence."""
    text = json.dumps(document, indent=2, ensure_ascii=False)
    return _NUMBERS.sub(lambda found: "[" + " ".join(found[1].split()) + "]", text) + "\n"
