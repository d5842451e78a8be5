"""Vehicle check: `python -m aerodaas.drivers.mavlink udpin:127.0.0.1:14540`."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from aerodaas.config.model import EnvironmentConfig, GeofenceConfig, RobotConfig
from aerodaas.drivers.mavlink.connecting import Connection
from aerodaas.drivers.mavlink.microservices.parameters import Parameters, unsafe_parameters
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.errors import AeroDaaSError

_SETTLING = 2.0
"""Seconds within which its slowest messages arrive."""


def main(
    url: Annotated[
        str, typer.Argument(help="As in the environment file.")
    ] = "udpin:127.0.0.1:14540",
    system: Annotated[int | None, typer.Option(help="The vehicle's system id.")] = None,
    timeout: Annotated[float, typer.Option(help="Seconds to wait for its HEARTBEAT.")] = 10.0,
    *,
    as_station: Annotated[
        bool,
        typer.Option("--ground-station", help='Judge it as if flown in "role": "ground_station".'),
    ] = False,
    set_failsafes: Annotated[
        bool, typer.Option("--set-failsafes", help="Set the failsafes that are found unsafe.")
    ] = False,
    restore: Annotated[
        bool,
        typer.Option("--restore", help="Put back what an earlier flight set for its fallback."),
    ] = False,
) -> None:
    """Connect, and print the vehicle's identity, its objections and its missing protections."""
    own = {"failsafes": "ignore", "fallback": "ignore"}
    settings = {"url": url, "system": system, **own, **MavlinkVehicle.observing}
    robot = RobotConfig(id="vehicle", driver="mavlink", settings=settings)
    vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
    try:
        vehicle.connect(timeout)
        time.sleep(_SETTLING)
        _print_vehicle(vehicle)
        if restore:
            vehicle.connection.fallback.restore()
        # Judged by this role, but never in it: its end would then be a loss of the ground station.
        role = MavlinkSettings(role="ground_station" if as_station else "companion")
        _judge(vehicle.connection, fix=set_failsafes)
        _judge_fallback(vehicle, role)
    except AeroDaaSError as error:
        typer.echo(error, err=True)
        raise typer.Exit(error.exit_code) from None
    finally:
        vehicle.close()


def _print_vehicle(vehicle: MavlinkVehicle) -> None:
    connection, state = vehicle.connection, vehicle.read()
    typer.echo(
        f"{connection.autopilot.name} {vehicle.telemetry.software}, system {connection.target[0]}: "
        f"{state.mode.value}, battery {state.battery.fraction:.0%}"
    )
    if state.gps is not None:
        gps = state.gps
        place = f"{gps.latitude:.6f}, {gps.longitude:.6f}"
        typer.echo(f"at {place}, {gps.satellites} satellites")
    for line in (line for component in vehicle.equipment for line in component.description()):
        typer.echo(line)
    for reason in vehicle.preflight():
        typer.echo(f"would not take off: {reason}")


def _judge(connection: Connection, *, fix: bool) -> None:
    parameters = Parameters(connection.link, connection.autopilot)
    found = unsafe_parameters(parameters, connection.autopilot)
    for unsafe in found:
        if fix:
            parameters.set(unsafe.failsafe.name, unsafe.failsafe.safe)
        typer.echo(f"{unsafe.text}{': set' if fix else ''}")
    if not found:
        typer.echo("failsafes: no parameter is unsafe")
    elif not fix:
        typer.echo("--set-failsafes sets them")


def _judge_fallback(vehicle: MavlinkVehicle, role: MavlinkSettings) -> None:
    connection = vehicle.connection
    ceiling = GeofenceConfig().ceiling
    obstacles = connection.fallback.under(role).examine(ceiling, vehicle.telemetry.software)
    for text in obstacles:
        typer.echo(f"would not come home without us: {text}")
    if obstacles:
        typer.echo('"fallback": "set" in the robot\'s settings does it for a flight')
    else:
        typer.echo(f"without us: {connection.autopilot.comes_home}")


if __name__ == "__main__":
    typer.run(main)
