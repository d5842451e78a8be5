"""The pace of a recorded flight, gathered from its file."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from aerodaas.recording.encoding import stream_of
from aerodaas.recording.reader import Record, Recording
from aerodaas.recording.replay.timeline import ReplayTimeline
from aerodaas.types.status import ReceivedMessage

__all__ = ["read_replay_timeline"]


class _Reading:
    """Gathers a recording's times, message by message."""

    def __init__(self) -> None:
        self.readings: dict[str, set[int]] = defaultdict(set)
        self.turns: dict[str, set[int]] = defaultdict(set)
        self.plans: dict[str, set[int]] = defaultdict(set)
        self.heard: dict[str, list[ReceivedMessage]] = defaultdict(list)
        self.work: dict[str, dict[str, dict[int, int | None]]] = defaultdict(
            lambda: defaultdict(dict)
        )

    def frame(self, record: Record) -> None:
        self.readings[record.value["source"]].add(record.value["stamp"])

    def reading(self, record: Record) -> None:
        """Of a sensor, whose stream is the topic without the kind of data."""
        name = record.topic.strip("/")
        # A stream that is named after the kind of its data does not repeat it.
        for stream in (name, name.rpartition("/")[0]):
            self.readings[stream_of(stream)].add(record.stamp)

    def result(self, record: Record) -> None:
        """Of an analysis; one without inputs measures something itself."""
        source = record.value["source"]
        if source == stream_of(record.topic.strip("/").rpartition("/")[0]):
            self.readings[source].add(record.value["stamp"])

    def setpoint(self, record: Record) -> None:
        value = record.value
        robot = value["robot"]
        self.turns[robot].add(value["stamp"])
        if value.get("planned"):
            self.plans[robot].add(value["stamp"])
        self.heard[robot] += [
            ReceivedMessage(one["stream"], one["source"], one["stamp"], one["at"])
            for one in value.get("heard", ())
        ]

    def latency(self, record: Record) -> None:
        value, stamp = record.value, record.captured
        if len(value["hops"]) == 1:
            self.readings[value["stream"]].add(stamp)
            return
        self.work[value["stream"]][value["source"]][stamp] = value["hops"][-1].get("state")


def read_replay_timeline(path: str | Path) -> ReplayTimeline:
    """Read the pace of a recording; raises RecordingError if it cannot be read."""
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
            "aerodaas.Setpoint": found.setpoint,
            "aerodaas.Latency": found.latency,
        }
        for record in recording.records(schemas=readers):
            # Another version's message: the rest is still worth keeping to.
            with suppress(KeyError, TypeError, IndexError, AttributeError):
                readers[record.schema](record)
    return ReplayTimeline(
        _sorted(found.readings),
        _sorted(found.turns),
        _sorted(found.plans),
        {robot: tuple(heard) for robot, heard in found.heard.items()},
        {
            stream: {source: dict(states) for source, states in sources.items()}
            for stream, sources in found.work.items()
        },
    )


def _sorted(stamps: dict[str, set[int]]) -> dict[str, tuple[int, ...]]:
    return {name: tuple(sorted(times)) for name, times in stamps.items()}
