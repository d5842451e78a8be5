"""`aerodaas preflight` and `logs`: a vehicle's health before take-off, and its own logs."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerodaas.cli.options import ENVIRONMENT, EnvironmentFile, Overrides
from aerodaas.errors import UnknownIdError, VehicleError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aerodaas.config.model import RobotConfig
    from aerodaas.messages.health import HealthItem
    from aerodaas.messages.vehicle import Vehicle
    from aerodaas.messages.vehicle_log import LogEntry, LoggingVehicle

__all__ = ["connected_robot", "logs", "preflight", "settled_items"]

_CONNECTING = 10.0
"""Wall seconds for a vehicle to answer."""


@contextmanager
def connected_robot(
    name: str, file: Path, settings: Iterable[str]
) -> Iterator[tuple[Vehicle, RobotConfig]]:
    """Connect the robot `name` of an environment file for the length of a `with`, to look at it.

    Nothing is changed at the vehicle, whatever a flight would set there, and no video is asked for.

    Args:
        name: Its id.
        file: The environment file.
        settings: `id.setting=value`, laid over the file.

    Raises:
        ConfigError: For a file or a setting that is wrong.
        UnknownIdError: If the file has no such robot.
        VehicleError: If the vehicle does not answer.
    """
    from aerodaas.config.overrides import parse_setting  # noqa: PLC0415 - slow to load
    from aerodaas.drivers.loading import load_vehicle  # noqa: PLC0415 - as above
    from aerodaas.environment.environment import Environment  # noqa: PLC0415 - as above

    overrides = dict(parse_setting(text) for text in settings)
    config = Environment(file.resolve(), overrides=overrides).config
    robots = {one.id: one for one in config.robots}
    if name not in robots:
        raise UnknownIdError("robot", name, list(robots))
    robot = robots[name]
    seen = robot.model_copy(update={"sensors": ()})
    with closing(load_vehicle(seen, config, observing=True)) as vehicle:
        vehicle.connect(_CONNECTING)
        yield vehicle, robot


_SETTLING = 2.0
"""Seconds within which a vehicle's slowest messages arrive."""
_MARKS = {
    "good": "[green]good[/]",
    "warning": "[yellow]warning[/]",
    "refused": "[red]refused[/]",
    "unknown": "[dim]unknown[/]",
}


def preflight(
    robot: Annotated[str, typer.Argument(help="Id of the robot.")],
    env: EnvironmentFile = ENVIRONMENT,
    setting: Overrides = None,
    as_json: Annotated[  # noqa: FBT002
        bool, typer.Option("--json", help="Print the list as JSON.")
    ] = False,
) -> None:
    """Print a robot's health before take-off as one list; nothing moves, and nothing is set there.

    Each item has its value, what it should be, what that means, and a remedy. The section
    `preflight` of the robot in the environment file says what refuses a take-off and what only
    warns. What the vehicle does not tell is unknown, never good. The exit code is 1 if a take-off
    would be refused.

        aerodaas preflight drone
        aerodaas preflight drone --env campus.json --json
        aerodaas preflight drone --set drone.preflight.wind=require
    """
    with connected_robot(robot, env, setting or ()) as (vehicle, config):
        items = settled_items(vehicle, config)
    refused = any(one.verdict.value == "refused" for one in items)
    if as_json:
        typer.echo(json.dumps({"robot": robot, "ready": not refused, "items": _health_rows(items)}))
    else:
        _print_health(robot, items)
    raise typer.Exit(1 if refused else 0)


def settled_items(vehicle: Vehicle, robot: RobotConfig) -> list[HealthItem]:
    """The list of a connected vehicle, once its slowest messages have come.

    It is read until then, for drivers watch over who steers by how often they are read.
    """
    from aerodaas.messages.vehicle import SteppedVehicle  # noqa: PLC0415 - as above
    from aerodaas.mission.safety.checklist import Checklist  # noqa: PLC0415 - slow to load

    checklist = Checklist(vehicle, robot.limits, robot.preflight)
    patience = 0.0 if isinstance(vehicle, SteppedVehicle) else _SETTLING
    until = time.monotonic() + patience
    while time.monotonic() < until:
        vehicle.read()
        time.sleep(0.1)
    return checklist.examine(vehicle.read())


def _health_rows(items: Sequence[HealthItem]) -> list[dict[str, str]]:
    return [{**asdict(one), "verdict": one.verdict.value} for one in items]


def _print_health(name: str, items: Sequence[HealthItem]) -> None:
    from rich.console import Console  # noqa: PLC0415 - slow to load
    from rich.table import Table  # noqa: PLC0415 - as above
    from rich.text import Text  # noqa: PLC0415 - as above

    table = Table(
        title=f"aerodaas preflight {name}", title_justify="left", box=None, pad_edge=False
    )
    for column in ("item", "value", "should be", "", "remedy"):
        table.add_column(column, overflow="fold")
    for one in items:
        # Texts, for some are the vehicle's own words, which may have brackets.
        told = [Text(cell) for cell in (one.name, one.value, one.bound)]
        table.add_row(*told, _MARKS[one.verdict.value], Text(one.remedy))
    Console().print(table)


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
    from aerodaas.messages.vehicle_log import LoggingVehicle  # noqa: PLC0415 - slow to load

    # Before anything is fetched: the recording may be none.
    flown = None if attach is None else _flight(attach, robot)
    with connected_robot(robot, env, setting or ()) as (vehicle, _):
        if not isinstance(vehicle, LoggingVehicle):
            driver = vehicle.capabilities.driver
            raise VehicleError(f"{robot}: no logs can be fetched by the driver {driver}")
        found = vehicle.logs()
        if numbers:
            chosen = _chosen(found, numbers)
        elif latest:
            chosen = _chosen(found, [max((one.number for one in found), default=0)])
        elif flown is not None:
            chosen = [_written_then(found, flown)]
        else:
            _print_logs(robot, found, as_json=as_json)
            return
        files = [_fetch(vehicle, one, to, quiet=as_json) for one in chosen]
    if as_json:
        typer.echo(json.dumps([str(file) for file in files]))
    if attach is not None:
        for file in files:
            _attach(attach, file, robot, quiet=as_json)


def _flight(recording: Path, robot: str) -> tuple[float, float]:
    from aerodaas.recording.vehicle_log.attachment import flight_of  # noqa: PLC0415 - slow to load

    return flight_of(recording, robot)


def _written_then(found: Sequence[LogEntry], flown: tuple[float, float]) -> LogEntry:
    from aerodaas.messages.vehicle_log import log_of_flight  # noqa: PLC0415 - slow to load

    chosen = log_of_flight(found, *flown)
    if chosen is None:
        raise VehicleError(
            f"the vehicle tells of no log that it was written at {_when(flown[0])}: list its logs, "
            "and name one by its number"
        )
    return chosen


def _attach(recording: Path, file: Path, robot: str, *, quiet: bool) -> None:
    from aerodaas.config.printable import printable  # noqa: PLC0415 - slow to load
    from aerodaas.recording.vehicle_log.attachment import attach_log  # noqa: PLC0415 - as above

    attached = attach_log(recording, file, robot)
    if not quiet:
        typer.echo(printable(str(attached)))


def _chosen(found: Sequence[LogEntry], numbers: Sequence[int]) -> list[LogEntry]:
    known = {one.number: one for one in found}
    missing = [number for number in numbers if number not in known]
    if missing:
        there = ", ".join(map(str, known)) or "none"
        raise VehicleError(f"the vehicle has no log {missing[0]}; it has {there}")
    return [known[number] for number in numbers]


def _fetch(vehicle: LoggingVehicle, log: LogEntry, folder: Path, *, quiet: bool) -> Path:
    from rich.progress import Progress  # noqa: PLC0415 - slow to load

    with Progress(disable=quiet, transient=True) as bar:
        task = bar.add_task(f"log {log.number}", total=log.size)
        file = vehicle.fetch_log(log, folder, lambda done, _: bar.update(task, completed=done))
    if not quiet:
        typer.echo(file)
    return file


def _print_logs(name: str, found: Sequence[LogEntry], *, as_json: bool) -> None:
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
