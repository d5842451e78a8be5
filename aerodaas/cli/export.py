"""`aerodaas export`: a recording for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from aerodaas.cli.report import Recorded
from aerodaas.config.printable import printable

if TYPE_CHECKING:
    from aerodaas.recording.reader import Recording

__all__ = ["export"]


def export(
    recording: Recorded,
    csv: Annotated[
        list[str] | None, typer.Option(metavar="TOPIC", help="Channel to write as CSV.")
    ] = None,
    parquet: Annotated[
        list[str] | None, typer.Option(metavar="TOPIC", help="Channel to write as Parquet.")
    ] = None,
    mp4: Annotated[bool, typer.Option("--mp4", help="A video of each camera.")] = False,  # noqa: FBT002
    overlays: Annotated[bool, typer.Option(help="Draw detections into the videos.")] = True,  # noqa: FBT002
    gpx: Annotated[bool, typer.Option("--gpx", help="The track as GPX.")] = False,  # noqa: FBT002
    kml: Annotated[bool, typer.Option("--kml", help="The track as KML.")] = False,  # noqa: FBT002
    coco: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            min=0,
            help="Pictures, at least so far apart, and what was detected, as a COCO dataset.",
        ),
    ] = None,
    lerobot: Annotated[
        str | None,
        typer.Option(
            metavar="TASK",
            help="Pictures, states and commands as a LeRobot dataset; the task in words.",
        ),
    ] = None,
    ros2: Annotated[
        Literal["mcap", "sqlite3"] | None,
        typer.Option(help="States, pictures and detections as a ROS 2 bag in this storage."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the files. Default: the recording's own.")
    ] = None,
) -> None:
    """Write parts of a recording as CSV, Parquet, MP4, GPX, KML, COCO, LeRobot or a ROS 2 bag.

    Without any of these, list the recording's channels.

        aerodaas export flight.mcap --csv /tello/state --csv /decisions/decision
        aerodaas export flight.mcap --mp4 --kml --out for_the_web
        aerodaas export flight.mcap --coco 0.5
        aerodaas export flight.mcap --lerobot "survey the field"
        aerodaas export flight.mcap --ros2 mcap
    """
    from aerodaas.recording.export import tabular, track, video  # noqa: PLC0415 - slow to load
    from aerodaas.recording.export.coco import write_coco  # noqa: PLC0415
    from aerodaas.recording.export.lerobot import write_lerobot  # noqa: PLC0415
    from aerodaas.recording.reader import Recording  # noqa: PLC0415
    from aerodaas.recording.ros import bag_writer  # noqa: PLC0415

    folder = out or recording.parent
    with Recording.open(recording) as opened:
        files = [tabular.write_csv(opened, topic, folder) for topic in csv or ()]
        files += [tabular.write_parquet(opened, topic, folder) for topic in parquet or ()]
        files += video.write_videos(opened, folder, overlays=overlays) if mp4 else []
        files += [track.write_gpx(opened, folder)] if gpx else []
        files += [track.write_kml(opened, folder)] if kml else []
        files += [] if coco is None else [write_coco(opened, folder, interval=coco)]
        files += [] if lerobot is None else write_lerobot(opened, folder, task=lerobot)
        files += [bag_writer.write_bag(opened, folder, ros2)] if ros2 else []
        lines = [str(path) for path in files] or _channels(opened)
        if opened.damaged:
            lines.append(f"skipped {opened.damaged} broken messages or chunks")
    typer.echo("\n".join(lines))


def _channels(recording: Recording) -> list[str]:
    topics = sorted(recording.topics.values(), key=lambda topic: topic.name)
    return [printable(f"{topic.count:>9}  {topic.name}  {topic.schema}") for topic in topics]
