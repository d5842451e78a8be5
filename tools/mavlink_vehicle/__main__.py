"""Switch an emulated autopilot on: `python -m tools.mavlink_vehicle --family px4`."""

from __future__ import annotations

from typing import Annotated

import typer

from tools.emulated import watch
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot, Impairment
from tools.mavlink_vehicle.aircraft import EmulatedAircraft


def main(
    family: Annotated[str, typer.Option(help="px4 or ardupilot.")] = "px4",
    host: Annotated[str, typer.Option(help="Where it sends.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Where it sends.")] = 14540,
    system: Annotated[int, typer.Option(help="Its system id.")] = 1,
    ready_after: Annotated[float, typer.Option(help="Seconds until it would arm.")] = 3.0,
    battery: Annotated[float, typer.Option(help="Charge, 0 to 1.")] = 0.9,
    noise: Annotated[float, typer.Option(help="Scale of its sensors' noise.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Of noise and link.")] = 0,
    *,
    remote_id: Annotated[bool, typer.Option(help="It has a Remote ID transmitter.")] = False,
    aircraft: Annotated[
        int, typer.Option(help="Aircraft that cross its sky, each 200 m off the one before.")
    ] = 0,
    loss: Annotated[float, typer.Option(help="Share of all packets that get lost.")] = 0.0,
    delay: Annotated[float, typer.Option(help="Seconds that all packets take.")] = 0.0,
) -> None:
    """Emulate PX4 or ArduCopter until Ctrl-C."""
    if family not in {"px4", "ardupilot"}:
        raise typer.BadParameter("px4 or ardupilot", param_hint="--family")
    link = Impairment(loss=loss, delay=delay)
    options = AutopilotOptions(
        family="px4" if family == "px4" else "ardupilot",
        peer=(host, port),
        system=system,
        ready_after=ready_after,
        battery=battery,
        noise=noise,
        seed=seed,
        remote_id=remote_id,
        uplink=link,
        downlink=link,
    )
    with EmulatedAutopilot(options) as autopilot:
        autopilot.firmware.traffic.aircraft.extend(map(crossing, range(aircraft)))
        typer.echo(f"emulated {family} sends to {host}:{port}, listens at {autopilot.port}")
        watch(autopilot)


def crossing(number: int) -> EmulatedAircraft:
    """One that flies past from the west, further off and higher than the one before."""
    place = (-2000.0, 200.0 * (number + 1), 100.0 + 50.0 * number)
    return EmulatedAircraft(0x4B1000 + number, f"HB{number:03d}", place, (30.0, 0.0, 0.0))


if __name__ == "__main__":
    typer.run(main)
