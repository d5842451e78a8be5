"""Preview of a world as one image: `python -m aerodaas.simulation field`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer

from aerodaas.config.model import SimulationConfig
from aerodaas.errors import AeroDaaSError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.renderer import Renderer
from aerodaas.simulation.world import World

__all__ = ["preview"]

_AROUND = (0, 60, 120, 180, 240, 300)
"""Directions of view in degrees."""


def preview(
    world: Annotated[str, typer.Argument(help="A world's name or a scenario file.")] = "field",
    *,
    seed: Annotated[int, typer.Option(help="Seed of layout and looks.", min=0)] = 0,
    time: Annotated[float, typer.Option(help="Seconds of mission time.", min=0.0)] = 20.0,
    east: Annotated[float, typer.Option(help="Metres east of home.")] = 0.0,
    north: Annotated[float, typer.Option(help="Metres north of home.")] = 0.0,
    height: Annotated[float, typer.Option(help="Metres above the ground.")] = 1.5,
    out: Annotated[Path, typer.Option(help="Where to write it.")] = Path("world.png"),
) -> None:
    """Render six views around a place, and one from above, into one image.

    Example: `python -m aerodaas.simulation campus --seed 3 --east 5 --out campus.png`
    """
    try:
        shown = World.load(SimulationConfig(world=world, seed=seed))
        camera = CameraModel.from_fov(640, 360, math.radians(82.6))
        renderer = Renderer(shown, camera)
        place = np.array([east, north, height])
        poses = [Odometry(place, np.zeros(3), math.radians(yaw)) for yaw in _AROUND]
        above = np.array([east, north - 12.0, height + 18.0])
        poses += [
            Odometry(above, np.zeros(3), math.radians(yaw), pitch=math.radians(45))
            for yaw in (90, 60)
        ]
        pictures = [renderer.render(time, pose) for pose in poses]
        renderer.close()
    except AeroDaaSError as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(error.exit_code) from None
    rows = [np.hstack(pictures[i : i + 2]) for i in range(0, len(pictures), 2)]
    if not cv2.imwrite(str(out), np.vstack(rows)):
        typer.echo(f"error: cannot write {out}; name a .png or .jpg in a folder you own", err=True)
        raise typer.Exit(1)
    typer.echo(f"wrote {out}")


if __name__ == "__main__":
    typer.run(preview)
