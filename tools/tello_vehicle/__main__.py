"""Switch an emulated Tello on: `python -m tools.tello_vehicle --port 8889`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.overrides import located
from aerodaas.errors import AeroDaaSError
from tools.emulated import watch
from tools.tello_vehicle import EmulatedTello, Impairment, TelloOptions, VideoOptions


def main(
    address: Annotated[str, typer.Option(help="Where it listens; loopback only.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Its port for commands; 0 for any.")] = 8889,
    sdk: Annotated[int, typer.Option(help="20 or 30; SDK 2.0 does not know `port`.")] = 30,
    battery: Annotated[float, typer.Option(help="Charge, 0 to 1.")] = 0.9,
    source: Annotated[str, typer.Option(help="What it films: world or clock.")] = "world",
    env: Annotated[
        Path | None,
        typer.Option(
            help="Environment file in whose simulated world it takes the first robot's place; "
            "stands for --world and --seed."
        ),
    ] = None,
    world: Annotated[str, typer.Option(help="World of the simulator.")] = "field",
    seed: Annotated[int, typer.Option(help="Of the world and of the link.")] = 0,
    width: Annotated[int, typer.Option(help="Pixels of the video.")] = 960,
    height: Annotated[int, typer.Option(help="Pixels of the video.")] = 720,
    rate: Annotated[float, typer.Option(help="Frames per second.")] = 30.0,
    loss: Annotated[float, typer.Option(help="Share of all packets that get lost.")] = 0.0,
    delay: Annotated[float, typer.Option(help="Seconds that all packets take.")] = 0.0,
    copy_to: Annotated[
        list[int] | None, typer.Option(help="Further ports on loopback that get the video.")
    ] = None,
) -> None:
    """Emulate a Tello until Ctrl-C; the first line gives its addresses."""
    link = Impairment(loss=loss, delay=delay)
    options = TelloOptions(
        address,
        port,
        sdk=_one_of(sdk, 20, 30),
        battery=battery,
        seed=seed,
        commands=link,
        replies=link,
        states=link,
        video_link=link,
        video=VideoOptions(
            source="clock" if source == "clock" else "world",
            world=world,
            seed=seed,
            width=width,
            height=height,
            rate=rate,
            copies=tuple(("127.0.0.1", other) for other in copy_to or ()),
        ),
    )
    try:
        if env is not None:
            options = options.placed(located(EnvironmentConfig.load(env), env.parent))
        tello = EmulatedTello(options)
    except AeroDaaSError as error:
        typer.echo(error, err=True)
        raise typer.Exit(error.exit_code) from None
    typer.echo(f"emulated Tello at {address}:{tello.port}")
    with tello:
        watch(tello)


def _one_of(value: int, one: Literal[20], other: Literal[30]) -> Literal[20, 30]:
    if value == one:
        return one
    if value == other:
        return other
    raise typer.BadParameter(f"{value} is neither {one} nor {other}", param_hint="--sdk")


if __name__ == "__main__":
    typer.run(main)
