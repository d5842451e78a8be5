"""Pictures of docs/gallery.md: `python -m tools.gallery flight.mcap docs/images`.

Of a recording a sheet of what the camera saw, with boxes; and a sweep of the lab.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import typer
from numpy.typing import NDArray

from aerodaas.extensions.notebook import Pictures, recorded_pictures
from aerodaas.schedulers.lab import run_sweep
from aerodaas.schedulers.lab.plots import plot_sweep

__all__ = ["draw_sweep", "sheet"]

_WIDTH = 320
"""Pixels of one picture."""
_GAP = 6
_ACROSS = 3
_QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 80]


def main(
    recording: Annotated[Path, typer.Argument(help="A flight that has a camera.")],
    folder: Annotated[Path, typer.Argument(help="Where the pictures go.")],
) -> None:
    """Write `boxes.jpg` and `sweep.png`."""
    boxes = sheet(recorded_pictures(recording, count=2 * _ACROSS))
    cv2.imwrite(str(folder / "boxes.jpg"), boxes, _QUALITY)
    draw_sweep(folder / "sweep.png", seconds=60, seeds=10)


def sheet(pictures: Pictures) -> NDArray[np.uint8]:
    """Pictures of one size side by side, three to a row, on white."""
    height = round(pictures[0].image.shape[0] * _WIDTH / pictures[0].image.shape[1])
    rows = -(-len(pictures) // _ACROSS)
    page = np.full((rows * (height + _GAP) - _GAP, _ACROSS * (_WIDTH + _GAP) - _GAP, 3), 255)
    for place, one in enumerate(pictures):
        top, left = place // _ACROSS * (height + _GAP), place % _ACROSS * (_WIDTH + _GAP)
        small = cv2.resize(one.image, (_WIDTH, height), interpolation=cv2.INTER_AREA)
        page[top : top + height, left : left + _WIDTH] = small
    return page.astype(np.uint8)


def draw_sweep(path: Path, *, seconds: float, seeds: int) -> None:
    """Four schedulers with more and more drones, over a steady and a changing network."""
    parameters: dict[str, list[Any]] = {
        "drones": [1, 2, 3, 4, 6],
        "network": ["steady", "trapezium"],
    }
    schedulers = ["ec_edf", "dems", "gems", "margin"]
    result = run_sweep(schedulers, parameters, seeds=range(seeds), duration=seconds)
    plot_sweep(result, "qos per s", path)


if __name__ == "__main__":
    typer.run(main)
