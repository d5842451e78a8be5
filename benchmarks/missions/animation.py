"""A short animation of a recorded flight: `python benchmarks/missions/animation.py flight.mcap`.

What the camera saw, with boxes and the mission's state drawn in, much faster than it was.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from numpy.typing import NDArray
from PIL import Image

from aerodaas.clock import NANOSECONDS
from aerodaas.recording.pictures import detections_by_frame, frames
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.overlay import draw_detections, draw_line


def main(
    recording: Annotated[Path, typer.Argument(help="The flight.")],
    out: Annotated[Path, typer.Argument(help="Where the WebP file goes.")],
    pictures: Annotated[int, typer.Option(help="How many.", min=2)] = 60,
    width: Annotated[int, typer.Option(help="Pixels.", min=64)] = 400,
    pause: Annotated[int, typer.Option(help="Milliseconds per picture.", min=20)] = 150,
    quality: Annotated[int, typer.Option(help="0 to 100.", min=0, max=100)] = 45,
) -> None:
    """Write an animated WebP of the flight's first camera, from take-off to landing."""
    with Recording.open(recording) as opened:
        flight = RecordedFlight.read(opened)
        source, stamps = next(iter(flight.frame_stamps.items()))
        robot = flight.robots[source.partition("/")[0]]
        start, end = robot.bands[0].start * NANOSECONDS, robot.bands[-1].start * NANOSECONDS
        flown = np.array([stamp for stamp in stamps if start <= stamp <= end])
        chosen = set(flown[np.linspace(0, len(flown) - 1, pictures).astype(int)].tolist())
        found = detections_by_frame(opened)
        shown = []
        for frame in frames(opened, stamps=chosen):
            if frame.header.source != source:
                continue
            stamp = frame.header.stamp
            image = frame.image.copy()
            draw_detections(image, found.get((source, stamp), ()))
            second = stamp / NANOSECONDS
            draw_line(image, f"{second:.0f} s  {robot.state_at(np.array([second]))[0]}")
            shown.append(_shrunk(image, width))
    if not shown:
        typer.echo(f"error: {recording} holds no pictures", err=True)
        sys.exit(1)
    first, *rest = shown
    first.save(
        out, save_all=True, append_images=rest, duration=pause, loop=0, quality=quality, method=6
    )
    typer.echo(f"wrote {out}: {len(shown)} pictures, {out.stat().st_size / 1e6:.2f} MB")


def _shrunk(image: NDArray[np.uint8], width: int) -> Image.Image:
    height = round(image.shape[0] * width / image.shape[1])
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return Image.fromarray(cv2.cvtColor(small, cv2.COLOR_BGR2RGB))


if __name__ == "__main__":
    typer.run(main)
