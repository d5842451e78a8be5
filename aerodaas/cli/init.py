"""`aerodaas init`: an environment file, by questions, by options, or by discovery."""

from __future__ import annotations

import json
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerodaas.errors import ConfigError

if TYPE_CHECKING:
    from aerodaas.config.environment_choices import EnvironmentChoices

__all__ = ["init"]

_SCHEMA = "environment.schema.json"
_TELLO = "tello"
_NUMBERS = re.compile(r"\[\n\s*(-?[\d.]+(?:,\n\s*-?[\d.]+)*)\n\s*\]")
"""A list of numbers over several lines, as no string of JSON holds a line's end."""


def init(
    *,
    vehicle: Annotated[
        str | None,
        typer.Option("--vehicle", "-v", help="`simulated`, `px4`, `ardupilot` or `tello`."),
    ] = None,
    url: Annotated[
        str | None,
        typer.Option(
            help="Where it is: a MAVLink URL such as `udpin:127.0.0.1:14540` or "
            "`serial:/dev/ttyACM0:57600`, or a Tello's address."
        ),
    ] = None,
    camera: Annotated[
        list[str] | None,
        typer.Option(
            "--camera",
            "-c",
            help="A device (`/dev/video0`), a URL (`rtsp://…`), a file or a folder of pictures, "
            "or `simulated`, `tello`, `none`; may be given several times. Default: the one that "
            "the vehicle brings along.",
        ),
    ] = None,
    discover: Annotated[
        bool,
        typer.Option(
            "--discover",
            help="Listen for MAVLink and for a Tello, and look for video devices. Nothing is sent "
            "off this machine.",
        ),
    ] = False,
    ask_tello: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="With --discover, also send `command` to this address, as to 192.168.10.1.",
        ),
    ] = None,
    address: Annotated[
        str | None,
        typer.Option(help="Also ask this Ray cluster (`host:port`) which nodes it has."),
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
    from aerodaas.config.environment_choices import EnvironmentChoices  # noqa: PLC0415 - slow to load

    _require_free(output, force=force)
    if not discover and ask_tello is not None:
        raise ConfigError("--ask-tello goes with --discover")
    if discover:
        beginning = _discovered(vehicle, url, camera, ask_tello, seconds)
    elif vehicle is None:
        if url is not None or camera:
            raise ConfigError("say whose it is, too: --vehicle simulated, px4, ardupilot or tello")
        beginning = _asked()
    else:
        beginning = EnvironmentChoices(vehicle, url, cameras=camera)
    _write(beginning, _compute(address), output, force=force)


def _require_free(output: Path, *, force: bool) -> None:
    """Refuse a file that is there before anything is asked."""
    if output.exists() and not force:
        raise ConfigError(f"{output} is there already: --force writes over it, --output elsewhere")


def _asked() -> EnvironmentChoices:
    from aerodaas.cameras.devices import video_devices  # noqa: PLC0415 - only where it is asked
    from aerodaas.config.environment_choices import (  # noqa: PLC0415 - slow to load
        VEHICLES,
        EnvironmentChoices,
        camera_words,
        default_address,
    )

    try:
        vehicle = typer.prompt(f"Which vehicle: {', '.join(VEHICLES)}?", VEHICLES[0])
        while vehicle not in VEHICLES:
            vehicle = typer.prompt("One of these", VEHICLES[0])
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
            "nobody answers: say --vehicle simulated, px4, ardupilot or tello, or --discover"
        ) from None
    return EnvironmentChoices(vehicle, address, cameras=cameras)


def _discovered(
    vehicle: str | None,
    url: str | None,
    cameras: list[str] | None,
    ask_tello: str | None,
    seconds: float,
) -> EnvironmentChoices:
    """Choices by options first, then by discovery, which is printed."""
    from aerodaas.cameras.devices import video_devices  # noqa: PLC0415 - only where it is asked
    from aerodaas.config.environment_choices import EnvironmentChoices, camera_words  # noqa: PLC0415 - slow to load
    from aerodaas.drivers.mavlink.discovery import hear_vehicles  # noqa: PLC0415 - slow to load
    from aerodaas.drivers.tello.discovery import find_tello  # noqa: PLC0415 - slow to load

    typer.echo(f"listening for {seconds:g} s")
    with ThreadPoolExecutor(1) as thread:
        tello_found = thread.submit(find_tello, seconds, ask_tello)
        heard = hear_vehicles(seconds)
        tello = tello_found.result()
    devices, notes = video_devices()
    found = [EnvironmentChoices(one.family, one.url, one.system) for one in heard.vehicles]
    told = [one.text for one in heard.vehicles]
    if tello.address is not None:
        found.append(EnvironmentChoices(_TELLO, tello.address))
        told.append(f"tello at {tello.address}")
    for line in [*told, *(f"camera {one.path}: {one.name}" for one in devices)]:
        typer.echo(f"  found: {line}")
    for line in (*heard.notes, *tello.notes, *notes):
        typer.echo(f"  {line}")
    fitting = [one for one in found if vehicle in {None, one.vehicle}]
    if vehicle is None and not fitting:
        raise ConfigError(
            "no vehicle was found: switch it on and try again, or say --vehicle simulated, px4, "
            "ardupilot or tello"
        )
    chosen = fitting[0] if fitting else EnvironmentChoices(vehicle or "")
    if len(fitting) > 1:
        typer.echo("  written is the first; another one by --vehicle and --url")
    alone = [one.address for one in found].count(chosen.address) == 1
    if cameras is None:
        cameras = [*camera_words(chosen.vehicle), *(one.path for one in devices)] or None
    return EnvironmentChoices(
        chosen.vehicle, url or chosen.address, None if alone or url else chosen.system, cameras
    )


def _compute(address: str | None) -> list[dict[str, str]] | None:
    """The resources of a cluster, as the environment file lists them."""
    if address is None:
        return None
    from aerodaas.actors.cluster import ray_cluster as cluster  # noqa: PLC0415 - loads ray

    try:
        cluster.connect(address)
        return [{"id": one.id, "kind": one.kind} for one in cluster.discover()]
    finally:
        cluster.disconnect()


def _write(
    beginning: EnvironmentChoices,
    compute: list[dict[str, str]] | None,
    output: Path,
    *,
    force: bool,
) -> None:
    from aerodaas.config.model import validated  # noqa: PLC0415 - slow to load
    from aerodaas.config.schema import environment_schema  # noqa: PLC0415 - slow to load
    from aerodaas.runtime.checks import check_environment  # noqa: PLC0415 - slow to load

    if compute is not None:
        beginning = replace(beginning, compute=compute)
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
