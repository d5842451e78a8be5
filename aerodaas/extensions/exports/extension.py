"""What exports add to the core: formats of `aerodaas export`."""

from aerodaas.config.extensions import Command, Extension

_COMMANDS = "aerodaas.extensions.exports.commands"

EXTENSION = Extension(
    name="exports",
    summary="Recordings as videos, tracks, and datasets for training.",
    exports=(
        Command("mp4", f"{_COMMANDS}:mp4", "Write a video of each camera."),
        Command("gpx", f"{_COMMANDS}:gpx", "Write the track as GPX."),
        Command("kml", f"{_COMMANDS}:kml", "Write the track as KML."),
        Command("coco", f"{_COMMANDS}:coco", "Write pictures and detections as a COCO dataset."),
        Command(
            "lerobot",
            f"{_COMMANDS}:lerobot",
            "Write pictures, states and commands as a LeRobot dataset.",
        ),
    ),
)
