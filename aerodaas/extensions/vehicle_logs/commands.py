"""`aerodaas logs` and `attach`: the logs that a vehicle keeps itself."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerodaas.cli.flying.preflight import connected_robot
from aerodaas.cli.options import ENVIRONMENT, EnvironmentFile, Overrides
from aerodaas.errors import VehicleError
from aerodaas.text.printable import printable

if TYPE_CHECKING:
    from aerodaas.extensions.vehicle_logs.log_service import LogEntry, LogService
    from aerodaas.messages.vehicle import Vehicle

__all__ = ["attach", "logs"]


def logs(
    robot: Annotated[str, typer.Argument(help="Id of the robot.")],
    numbers: Annotated[
        list[int] | None, typer.Argument(help="Logs to fetch; none lists them.")
    ] = None,
    latest: Annotated[  # noqa: FBT002
        bool, typer.Option("--latest", help="Fetch the newest one.")
    ] = False,
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
    as_json: Annotated[  # noqa: FBT002
        bool, typer.Option("--json", help="Print the list, or the files, as JSON.")
    ] = False,
) -> None:
    """List the logs that a robot's autopilot keeps, or fetch some of them into a folder.

    On the ground only. No parameter and no plan of the vehicle is changed, whatever a flight sets.

    aerodaas logs drone
    aerodaas logs drone --latest --to runs/logs
    aerodaas logs drone 3 4 --env campus.json
    aerodaas logs drone --attach runs/survey-20260101-120000/flight.mcap
    """
    from aerodaas.extensions.vehicle_logs.attachment import (  # noqa: PLC0415 - slow to load
        attach_log,
        flight_of,
    )

    # Before anything is fetched: the recording may be none.
    flown = None if attach is None else flight_of(attach, robot)
    with connected_robot(robot, env, setting or ()) as (vehicle, _):
        service = _log_service(vehicle, robot)
        found = service.logs()
        if numbers:
            chosen = _chosen(found, numbers)
        elif latest:
            chosen = _chosen(found, [max((one.number for one in found), default=0)])
        elif flown is not None:
            chosen = [_written_then(found, flown)]
        else:
            _show(robot, found, as_json=as_json)
            return
        files = [_fetch(service, one, to, quiet=as_json) for one in chosen]
    if as_json:
        typer.echo(json.dumps([str(file) for file in files]))
    if attach is not None:
        for file in files:
            attached = attach_log(attach, file, robot)
            if not as_json:
                typer.echo(printable(str(attached)))


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

    `aerodaas report` draws its main topics then. `aerodaas logs ROBOT --attach RECORDING` fetches
    the log from the vehicle first.

    aerodaas attach runs/survey-20260101-120000/flight.mcap 00000012.BIN
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


def _log_service(vehicle: Vehicle, robot: str) -> LogService:
    """Log service of a robot's vehicle; VehicleError if its driver has none."""
    from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle  # noqa: PLC0415 - slow to load
    from aerodaas.extensions.vehicle_logs.log_service import (  # noqa: PLC0415 - as above
        LogService,
    )
    from aerodaas.extensions.vehicle_logs.mavlink_logs import MavlinkLogs  # noqa: PLC0415 - as above

    service = MavlinkLogs(vehicle) if isinstance(vehicle, MavlinkVehicle) else vehicle
    if not isinstance(service, LogService):
        driver = vehicle.capabilities.driver
        raise VehicleError(f"{robot}: no logs can be fetched by the driver {driver}")
    return service


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
