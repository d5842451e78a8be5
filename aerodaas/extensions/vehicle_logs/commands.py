"""`aerodaas logs`: the logs that a vehicle keeps itself."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerodaas.cli.flying.preflight import connected_robot
from aerodaas.cli.options import ENVIRONMENT, EnvironmentFile, ExampleGroup, Overrides
from aerodaas.errors import ConfigError, VehicleError
from aerodaas.text.printable import printable

if TYPE_CHECKING:
    from aerodaas.extensions.vehicle_logs.log_service import LogEntry, LogService

__all__ = ["app"]

Robot = Annotated[str, typer.Argument(help="Id of the robot.")]

app = typer.Typer(
    cls=ExampleGroup,
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="""List, fetch and attach the logs that a robot's autopilot keeps.

    aerodaas logs list drone
    aerodaas logs fetch drone --latest --to runs/logs
    aerodaas logs attach runs/survey-20260101-120000/flight.mcap 00000012.BIN
""",
)


@app.command("list")
def list_logs(
    robot: Robot,
    env: EnvironmentFile = ENVIRONMENT,
    setting: Overrides = None,
    as_json: Annotated[bool, typer.Option("--json", help="For programs.")] = False,  # noqa: FBT002
) -> None:
    """List the logs that a robot's autopilot keeps, with number, time and size.

    On the ground only. No parameter and no plan of the vehicle is changed, whatever a flight sets.

    aerodaas logs list drone
    aerodaas logs list drone --env campus.json --json
    """
    with _log_service(robot, env, setting) as service:
        _show(robot, service.logs(), as_json=as_json)


@app.command()
def fetch(
    robot: Robot,
    numbers: Annotated[list[int] | None, typer.Argument(help="Logs, as `list` tells them.")] = None,
    latest: Annotated[bool, typer.Option("--latest", help="The newest one.")] = False,  # noqa: FBT002
    attach: Annotated[
        Path | None,
        typer.Option(
            metavar="RECORDING",
            help="Attach what is fetched to the recording of its flight; without a number, the log "
            "that was written then.",
        ),
    ] = None,
    to: Annotated[Path, typer.Option(help="The folder for what is fetched.")] = Path(),
    env: EnvironmentFile = ENVIRONMENT,
    setting: Overrides = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the files as JSON.")] = False,  # noqa: FBT002
) -> None:
    """Fetch logs of a robot's autopilot into a folder.

    On the ground only. No parameter and no plan of the vehicle is changed, whatever a flight sets.

    aerodaas logs fetch drone --latest --to runs/logs
    aerodaas logs fetch drone 3 4 --env campus.json
    aerodaas logs fetch drone --attach runs/survey-20260101-120000/flight.mcap
    """
    from aerodaas.extensions.vehicle_logs.attachment import (  # noqa: PLC0415 - slow to load
        attach_log,
        flight_of,
    )

    # Before anything is fetched: the recording may be none.
    flown = None if attach is None else flight_of(attach, robot)
    if not numbers and not latest and flown is None:
        raise ConfigError("name the logs by their numbers, or give --latest or --attach RECORDING")
    with _log_service(robot, env, setting) as service:
        found = service.logs()
        if numbers:
            chosen = _chosen(found, numbers)
        elif latest or flown is None:
            chosen = _chosen(found, [max((one.number for one in found), default=0)])
        else:
            chosen = [_written_then(found, flown)]
        files = [_fetch(service, one, to, quiet=as_json) for one in chosen]
    if as_json:
        typer.echo(json.dumps([str(file) for file in files]))
    if attach is not None:
        for file in files:
            attached = attach_log(attach, file, robot)
            if not as_json:
                typer.echo(printable(str(attached)))


@app.command()
def attach(
    recording: Annotated[
        Path, typer.Argument(help="The .mcap file of the run.", show_default=False)
    ],
    log: Annotated[
        Path,
        typer.Argument(help="The log: .bin of ArduPilot or .ulg of PX4.", show_default=False),
    ],
    robot: Annotated[
        str | None,
        typer.Option(help="Whose log it is. Default: the only robot with an autopilot."),
    ] = None,
) -> None:
    """Attach an autopilot's own log to the recording of its flight, its clock laid over.

    `aerodaas report` draws its main topics then. `aerodaas logs fetch ROBOT --attach RECORDING`
    fetches the log from the vehicle first.

    aerodaas logs attach runs/survey-20260101-120000/flight.mcap 00000012.BIN
    """
    from aerodaas.extensions.vehicle_logs.attachment import (  # noqa: PLC0415 - slow to load
        attach_log,
    )

    typer.echo(printable(str(attach_log(recording, log, robot))))


def _written_then(found: Sequence[LogEntry], flown: tuple[float, float]) -> LogEntry:
    from aerodaas.extensions.vehicle_logs.log_service import (  # noqa: PLC0415 - slow to load
        log_of_flight,
    )

    chosen = log_of_flight(found, *flown)
    if chosen is None:
        raise VehicleError(
            f"the vehicle tells of no log that it was written at {_when(flown[0])}: list its logs, "
            "and name one by its number"
        )
    return chosen


@contextmanager
def _log_service(name: str, file: Path, settings: Iterable[str] | None) -> Iterator[LogService]:
    """Log service of a connected robot's vehicle; VehicleError if its driver has none."""
    from aerodaas.config.overrides import parse_setting  # noqa: PLC0415 - slow to load
    from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle  # noqa: PLC0415 - as above
    from aerodaas.environment.environment import Environment  # noqa: PLC0415 - as above
    from aerodaas.extensions.vehicle_logs.log_service import LogService  # noqa: PLC0415 - as above
    from aerodaas.extensions.vehicle_logs.mavlink_logs import MavlinkLogs  # noqa: PLC0415 - as above

    overrides = dict(parse_setting(text) for text in settings or ())
    config = Environment(file.resolve(), overrides=overrides).config
    with connected_robot(name, config) as (vehicle, _):
        service = MavlinkLogs(vehicle) if isinstance(vehicle, MavlinkVehicle) else vehicle
        if not isinstance(service, LogService):
            driver = vehicle.capabilities.driver
            raise VehicleError(f"{name}: no logs can be fetched by the driver {driver}")
        yield service


def _chosen(found: Sequence[LogEntry], numbers: Sequence[int]) -> list[LogEntry]:
    known = {one.number: one for one in found}
    missing = [number for number in numbers if number not in known]
    if missing:
        there = ", ".join(map(str, known)) or "none"
        raise VehicleError(f"the vehicle has no log {missing[0]}; it has {there}")
    return [known[number] for number in numbers]


def _fetch(service: LogService, log: LogEntry, folder: Path, *, quiet: bool) -> Path:
    from rich.progress import Progress  # noqa: PLC0415 - slow to load

    with Progress(disable=quiet, transient=True) as bar:
        task = bar.add_task(f"log {log.number}", total=log.size)
        file = service.fetch_log(log, folder, lambda done, _: bar.update(task, completed=done))
    if not quiet:
        typer.echo(file)
    return file


def _show(name: str, found: Sequence[LogEntry], *, as_json: bool) -> None:
    from rich.console import Console  # noqa: PLC0415 - slow to load
    from rich.table import Table  # noqa: PLC0415 - as above

    if as_json:
        typer.echo(json.dumps([asdict(one) for one in found]))
        return
    if not found:
        typer.echo(f"{name} has no logs")
        return
    table = Table(box=None, pad_edge=False)
    # Each autopilot tells one of the two.
    ends = any(one.ended is not None for one in found)
    for column in ("log", "last written" if ends else "began", "MB"):
        table.add_column(column)
    for one in found:
        when = _when(one.ended if ends else one.began)
        table.add_row(str(one.number), when, f"{one.size / 1e6:.2f}")
    Console().print(table)


def _when(began: float | None) -> str:
    if began is None:
        return "not known"
    return f"{datetime.fromtimestamp(began, timezone.utc):%Y-%m-%d %H:%M:%S} UTC"
