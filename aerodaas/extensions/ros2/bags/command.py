"""`aerodaas import` and `aerodaas export ros2`: bags read and written."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from aerodaas.cli.recordings.export import Folder, export
from aerodaas.cli.recordings.report import Recorded
from aerodaas.errors import ConfigError
from aerodaas.text.printable import printable

if TYPE_CHECKING:
    from aerodaas.extensions.ros2.bags.bag import RosBag
    from aerodaas.extensions.ros2.bags.importing import ImportedBag

__all__ = ["import_bag", "ros2"]

Taken = Annotated[
    str | None,
    typer.Option(metavar="TOPIC", help="What becomes the sensor that is called as the option."),
]


def import_bag(
    bag: Annotated[
        Path,
        typer.Argument(help="A ROS 2 bag: its folder, or its .mcap file.", show_default=False),
    ],
    camera: Annotated[
        list[str] | None,
        typer.Option(metavar="[ID=]TOPIC", help="Pictures of the camera ID, `camera` if left out."),
    ] = None,
    odometry: Taken = None,
    gps: Taken = None,
    battery: Taken = None,
    robot: Annotated[str, typer.Option(help="Id of the vehicle in the recording.")] = "drone",
    images: Annotated[
        str, typer.Option(help="How raw pictures are encoded: jpeg, png or h264.")
    ] = "jpeg",
    out: Annotated[
        Path | None, typer.Option(help="Folder for the recording. Default: one in runs/.")
    ] = None,
) -> None:
    """Write topics of a ROS 2 bag as a recording, to replay, view and report on.

    Without any topic, list those of the bag and the options that take them. Odometry is to be in
    ENU and FLU, as REP 103 has it.

        aerodaas import my_bag
        aerodaas import my_bag --camera front=/front/image_raw/compressed --odometry /odom
        aerodaas replay runs/import-my_bag-20260101-120000/flight.mcap --app follow.py
    """
    from aerodaas.config.checked import checked  # noqa: PLC0415 - slow to load
    from aerodaas.config.model import RecordingConfig  # noqa: PLC0415
    from aerodaas.environment.recording_paths import recording_folder  # noqa: PLC0415
    from aerodaas.extensions.ros2.bags.bag import RosBag  # noqa: PLC0415
    from aerodaas.extensions.ros2.bags.bag_preview import BagTopics  # noqa: PLC0415
    from aerodaas.extensions.ros2.bags.importing import import_bag as write  # noqa: PLC0415

    taken = BagTopics(robot, _cameras(camera or ()), odometry, gps, battery)
    with RosBag.open(bag) as opened:
        if not taken.taken():
            typer.echo("\n".join(_topics(opened)))
            return
        folder = out or recording_folder(f"import-{bag.stem}")
        config = checked(RecordingConfig, {"images": images}, "--images")
        done = write(opened, taken, folder / "flight.mcap", config)
    typer.echo("\n".join(_told(done)))


def ros2(
    recording: Recorded,
    storage: Annotated[
        Literal["mcap", "sqlite3"], typer.Option(help="How the bag is stored.")
    ] = "mcap",
    out: Folder = None,
) -> None:
    """Write states, pictures and detections as a bag.

    aerodaas export ros2 flight.mcap
    aerodaas export ros2 flight.mcap --storage sqlite3
    """
    from aerodaas.extensions.ros2.bags.bag_writer import write_bag  # noqa: PLC0415 - slow to load

    export(recording, out, lambda opened, to: [write_bag(opened, to, storage)])


def _cameras(given: Iterable[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in given:
        name, equals, topic = text.rpartition("=")
        name = name if equals else "camera"
        if name in found:
            raise ConfigError(f"two topics would be {name!r}: name them, as in front={topic}")
        found[name] = topic
    return found


def _topics(bag: RosBag) -> list[str]:
    from aerodaas.extensions.ros2.bags.bag_preview import use_of  # noqa: PLC0415 - slow to load

    lines = []
    for topic in sorted(bag.topics.values(), key=lambda one: one.name):
        use = use_of(topic.schema)
        option = f"  --{use} {topic.name}" if use else ""
        lines.append(printable(f"{topic.count:>9}  {topic.name}  {topic.schema}{option}"))
    return lines or [f"{bag.path} has no topics"]


def _told(done: ImportedBag) -> list[str]:
    lines = [str(done.summary)]
    for topic, (count, reason) in done.skipped.items():
        lines.append(printable(f"skipped {count} of {topic}, the first because {reason}"))
    if not done.complete:
        lines.append("the bag was cut off at its end: what was recorded after that is missing")
    if done.damaged:
        lines.append(f"skipped {done.damaged} broken messages or chunks")
    for camera, known in done.lenses.items():
        if not known:
            lines.append(
                f"no lens is known of {camera}, whose camera_info is not in the bag: give "
                '"horizontal_fov" by `aerodaas replay --env`'
            )
    return lines
