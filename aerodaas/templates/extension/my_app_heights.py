"""A format of `aerodaas export` of your own: how high each drone flew."""

from pathlib import Path

from aerodaas.cli.recordings.export import Folder, export
from aerodaas.cli.recordings.report import Recorded
from aerodaas.recording.reader import Recording, vehicle_states
from aerodaas.recording.report.flight import RecordedFlight


def heights(recording: Recorded, out: Folder = None) -> None:
    """Write the greatest height of each drone, in metres.

    aerodaas export heights flight.mcap
    """
    export(recording, out, write_heights)


def write_heights(recording: Recording, folder: Path) -> list[Path]:
    """Write `heights.txt`, a line a drone.

    Args:
        recording: The recording.
        folder: Folder of the file, which exists.
    """
    lines = []
    for robot in RecordedFlight.read(recording).robots:
        states = vehicle_states(recording, robot)
        lines.append(f"{robot} {max(float(one.odometry.position[2]) for _, one in states):.2f}\n")
    path = folder / "heights.txt"
    path.write_text("".join(lines))
    return [path]
