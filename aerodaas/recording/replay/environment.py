"""What the replay of a recording needs: an environment with players, and each source's times."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

from aerodaas.config.model import CameraConfig, EnvironmentConfig, validated
from aerodaas.messages.frames import Header
from aerodaas.recording.encoding import stream_of, topic
from aerodaas.recording.reader import Record, Recording
from aerodaas.recording.recorded_environment import allowed_content, merged, recorded_content

__all__ = ["read_timetables", "replay_environment"]

_FINITE = frozenset({"folder", "recorded", "video", "mcap"})
"""Camera drivers that may run out of images, which ends a mission that depends on them."""


def replay_environment(path: str | Path, local: str | Path | None = None) -> EnvironmentConfig:
    """Environment of a recording, with vehicles and cameras played from the file.

    Args:
        path: The MCAP file.
        local: Environment file that gives what no recording may bring: plug-ins, packages,
            endpoints, nodes; None for none.

    Returns:
        What may be read of the recorded environment, laid over the local one, with replay
        drivers; recording is enabled without images.

    Raises:
        RecordingError: If the recording cannot be read or was not written by `aerodaas run`.
        ConfigError: If the local file, or what comes of both, is no environment.
    """
    path = Path(path).resolve()
    with Recording.open(path) as recording:
        recorded = allowed_content(recorded_content(recording))
    given: dict[str, Any] = {}
    if local is not None:
        given = EnvironmentConfig.load(local).model_dump(by_alias=True, exclude_unset=True)
    place = f"the environment in {path}"
    config = validated(merged(recorded, given), place)
    content = config.model_dump(by_alias=True)
    for robot in content["robots"]:
        robot["settings"] = {
            "path": str(path),
            "driver": robot["driver"],
            "settings": robot["settings"],
        }
        robot["driver"] = "replayed"
        for sensor in robot["sensors"]:
            _play(sensor, f"{robot['id']}/{sensor['id']}", path)
    for sensor in content["sensors"]:
        _play(sensor, sensor["id"], path)
    content["recording"] |= {"enabled": True, "path": None, "images": "none"}
    return validated(content, place)


def _play(sensor: dict[str, Any], stream: str, path: Path) -> None:
    if sensor["type"] != "camera":
        return
    lens = {key: it for key, it in sensor["settings"].items() if key in CameraConfig.model_fields}
    endless = sensor["driver"] not in _FINITE or lens.get("loop", False)
    played = {"path": str(path), "topic": topic(stream, "image"), "loop": endless}
    sensor["settings"] = lens | played
    sensor["driver"] = "replayed"


class _Reading:
    """Collects timestamps by stream, message by message."""

    def __init__(self) -> None:
        self.stamps: dict[str, set[int]] = defaultdict(set)

    def frame(self, record: Record) -> None:
        self._add(record.value.header)

    def reading(self, record: Record) -> None:
        """Add a sensor's reading; its stream is the topic without the kind of data."""
        name = record.topic.strip("/")
        # The topic of a stream that is named after its kind of data does not repeat the kind.
        for stream in (name, name.rpartition("/")[0]):
            self.stamps[stream_of(stream)].add(record.stamp)

    def result(self, record: Record) -> None:
        """Add an analysis's result if the analysis has no inputs and measures itself."""
        header: Header = record.value.header
        if header.source == stream_of(record.topic.strip("/").rpartition("/")[0]):
            self._add(header)

    def latency(self, record: Record) -> None:
        """Add a message that passed through one actor only and is thus a measurement."""
        if len(record.value.hops) == 1:
            self.stamps[record.value.stream].add(record.captured)

    def _add(self, header: Header) -> None:
        self.stamps[header.source].add(header.stamp)


def read_timetables(path: str | Path) -> dict[str, tuple[int, ...]]:
    """Read the measurement times of each source.

    Args:
        path: The MCAP file.

    Returns:
        Sorted timestamps (mission time, nanoseconds) by stream.

    Raises:
        RecordingError: If the recording cannot be read.
    """
    with Recording.open(path) as recording:
        found = _Reading()
        readers: dict[str, Callable[[Record], None]] = {
            "aerodaas.Frame": found.frame,
            "foxglove.Odometry": found.reading,
            "foxglove.LocationFix": found.reading,
            "aerodaas.Battery": found.reading,
            "aerodaas.MissionStatus": found.reading,
            "aerodaas.Detections": found.result,
            "aerodaas.Navigation": found.result,
            "aerodaas.Value": found.result,
            "aerodaas.Latency": found.latency,
        }
        for record in recording.records(schemas=readers):
            readers[record.schema](record)
    return {stream: tuple(sorted(stamps)) for stream, stamps in found.stamps.items()}
