"""`aerodaas check --robot`: the health of one robot's vehicle before take-off, as one list."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

from aerodaas.errors import UnknownIdError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aerodaas.config.model import EnvironmentConfig, RobotConfig
    from aerodaas.messages.health import HealthItem
    from aerodaas.messages.vehicle import Vehicle

__all__ = ["connected_robot", "settled_items", "show_health"]

_CONNECTING = 10.0
"""Wall seconds for a vehicle to answer."""


@contextmanager
def connected_robot(name: str, config: EnvironmentConfig) -> Iterator[tuple[Vehicle, RobotConfig]]:
    """Connect the robot `name` of an environment for the length of a `with`, to look at it.

    Nothing is changed at the vehicle, whatever a flight would set there, and no video is asked for.

    Args:
        name: Its id.
        config: The environment.

    Raises:
        UnknownIdError: If the environment has no such robot.
        VehicleError: If the vehicle does not answer.
    """
    from aerodaas.drivers.loading import load_vehicle  # noqa: PLC0415 - slow to load

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


def show_health(name: str, config: EnvironmentConfig, *, as_json: bool) -> bool:
    """Print a robot's health before take-off as one list; nothing moves, and nothing is set there.

    Args:
        name: Id of the robot.
        config: Its environment.
        as_json: Whether it is printed for programs.

    Returns:
        False if a take-off would be refused.

    Raises:
        UnknownIdError: If the environment has no such robot.
        VehicleError: If the vehicle does not answer.
    """
    with connected_robot(name, config) as (vehicle, robot):
        items = settled_items(vehicle, robot)
    ready = all(one.verdict.value != "refused" for one in items)
    if as_json:
        typer.echo(json.dumps({"robot": name, "ready": ready, "items": _rows(items)}))
    else:
        _show(name, items)
    return ready


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


def _rows(items: Sequence[HealthItem]) -> list[dict[str, str]]:
    return [{**asdict(one), "verdict": one.verdict.value} for one in items]


def _show(name: str, items: Sequence[HealthItem]) -> None:
    from rich.console import Console  # noqa: PLC0415 - slow to load
    from rich.table import Table  # noqa: PLC0415 - as above
    from rich.text import Text  # noqa: PLC0415 - as above

    table = Table(title=f"{name} before take-off", title_justify="left", box=None, pad_edge=False)
    for column in ("item", "value", "should be", "", "remedy"):
        table.add_column(column, overflow="fold")
    for one in items:
        # Texts, for some are the vehicle's own words, which may have brackets.
        told = [Text(cell) for cell in (one.name, one.value, one.bound)]
        table.add_row(*told, _MARKS[one.verdict.value], Text(one.remedy))
    Console().print(table)
