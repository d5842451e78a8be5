"""Measurement times of each source of a recorded flight, for its replay."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

from aerodaas.messages.frames import Header
from aerodaas.recording.encoding import stream_of
from aerodaas.recording.reader import Record, Recording

__all__ = ["read_timetables"]


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
