"""Switch an emulated autopilot on: `python -m tools.mavlink_vehicle --family px4`."""

from __future__ import annotations

from typing import Annotated

import typer

from aerodaas.testing.emulated import watch
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot, Impairment


def main(
    family: Annotated[str, typer.Option(help="px4 or ardupilot.")] = "px4",
    host: Annotated[str, typer.Option(help="Where it sends.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Where it sends.")] = 14540,
    system: Annotated[int, typer.Option(help="Its system id.")] = 1,
    ready_after: Annotated[float, typer.Option(help="Seconds until it would arm.")] = 3.0,
    battery: Annotated[float, typer.Option(help="Charge, 0 to 1.")] = 0.9,
    noise: Annotated[float, typer.Option(help="Scale of its sensors' noise.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Of noise and link.")] = 0,
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
        uplink=link,
        downlink=link,
    )
    with EmulatedAutopilot(options) as autopilot:
        typer.echo(f"emulated {family} sends to {host}:{port}, listens at {autopilot.port}")
        watch(autopilot)


if __name__ == "__main__":
    typer.run(main)
