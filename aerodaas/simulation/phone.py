"""GPS log of a simulated person's phone: `python -m aerodaas.simulation.phone`."""

from __future__ import annotations

import csv
import random
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from aerodaas.config.model import SimulationConfig
from aerodaas.errors import AeroDaaSError
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.simulation.world import World

__all__ = ["write_log"]

_SIGMA, _MEMORY = 1.2, 0.97
"""Position error of a phone in the open in metres, and its correlation after one second."""
_BEGAN = datetime(2025, 1, 1, 9, tzinfo=timezone.utc)


def write_log(path: Path, world: World, person: str, origin: GeodeticOrigin, end: float) -> None:
    """Write one CSV row per second, in a logger's format.

    Errors are a first-order Gauss-Markov process, drawn from the world's seed.

    Args:
        path: File to write.
        world: The world that the person walks in.
        person: Id of the person.
        origin: Geodetic origin of the world.
        end: Last second of mission time.

    Raises:
        KeyError: If the world has no person of that name.
    """
    draw, thing = random.Random(f"{world.seed}/phone"), world.thing(person)
    east, north = (draw.gauss(0, _SIGMA) for _ in range(2))
    fresh = _SIGMA * (1 - _MEMORY**2) ** 0.5
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["time", "latitude", "longitude", "altitude", "accuracy"])
        for second in range(round(end) + 1):
            state = thing.state(float(second))
            place = np.array([state.x + east, state.y + north, 1.0])
            latitude, longitude, altitude = origin.to_geodetic(place)
            moment = _BEGAN + timedelta(seconds=second)
            rows.writerow(
                [
                    f"{moment:%Y-%m-%dT%H:%M:%SZ}",
                    f"{latitude:.7f}",
                    f"{longitude:.7f}",
                    f"{altitude:.1f}",
                    f"{2 * _SIGMA:.1f}",
                ]
            )
            east, north = (_MEMORY * error + draw.gauss(0, fresh) for error in (east, north))


def main(
    world: Annotated[str, typer.Argument(help="A world's name or a scenario file.")] = "campus",
    person: Annotated[str, typer.Argument(help="Whose phone.")] = "vip",
    *,
    seed: Annotated[int, typer.Option(help="Seed of the world.", min=0)] = 0,
    seconds: Annotated[float, typer.Option(help="Length of the log.", min=0)] = 300.0,
    home: Annotated[
        tuple[float, float, float], typer.Option(help="Latitude, longitude and altitude of home.")
    ] = (13.0166, 77.5695, 920.0),
    out: Annotated[Path, typer.Option(help="Where to write it.")] = Path("phone.csv"),
) -> None:
    """Write the log of a GPS logger carried by a person.

    Example: `python -m aerodaas.simulation.phone campus vip --seed 3 --out vip_log.csv`
    """
    try:
        shown = World.load(SimulationConfig(world=world, seed=seed))
        write_log(out, shown, person, GeodeticOrigin(*home), seconds)
    except (AeroDaaSError, KeyError, OSError) as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(1) from None


if __name__ == "__main__":
    typer.run(main)
