"""Formats of `aerodaas export`: MP4, GPX, KML, COCO and LeRobot."""

from __future__ import annotations

from typing import Annotated

import typer

from aerodaas.cli.recordings.export import Folder, export
from aerodaas.cli.recordings.report import Recorded
from aerodaas.extensions.exports.coco import write_coco
from aerodaas.extensions.exports.lerobot import write_lerobot
from aerodaas.extensions.exports.track import write_gpx, write_kml
from aerodaas.extensions.exports.video import write_videos

__all__ = ["coco", "gpx", "kml", "lerobot", "mp4"]


def mp4(
    recording: Recorded,
    overlays: Annotated[bool, typer.Option(help="Draw detections into the videos.")] = True,  # noqa: FBT002
    out: Folder = None,
) -> None:
    """Write a video of each camera.

    aerodaas export mp4 flight.mcap
    aerodaas export mp4 flight.mcap --no-overlays --out for_the_web
    """
    export(recording, out, lambda opened, to: write_videos(opened, to, overlays=overlays))


def gpx(recording: Recorded, out: Folder = None) -> None:
    """Write the track as GPX.

    aerodaas export gpx flight.mcap
    """
    export(recording, out, lambda opened, to: [write_gpx(opened, to)])


def kml(recording: Recorded, out: Folder = None) -> None:
    """Write the track as KML.

    aerodaas export kml flight.mcap
    """
    export(recording, out, lambda opened, to: [write_kml(opened, to)])


def coco(
    recording: Recorded,
    interval: Annotated[
        float,
        typer.Option(metavar="SECONDS", min=0, help="Least time from one picture to the next."),
    ] = 0.0,
    out: Folder = None,
) -> None:
    """Write pictures and detections as a COCO dataset.

    aerodaas export coco flight.mcap --interval 0.5
    """
    export(recording, out, lambda opened, to: [write_coco(opened, to, interval=interval)])


def lerobot(
    recording: Recorded,
    task: Annotated[str, typer.Argument(help="The task in words.", show_default=False)],
    out: Folder = None,
) -> None:
    """Write pictures, states and commands as a LeRobot dataset.

    aerodaas export lerobot flight.mcap "survey the field"
    """
    export(recording, out, lambda opened, to: write_lerobot(opened, to, task=task))
