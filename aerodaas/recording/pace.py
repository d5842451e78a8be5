"""When everything happened in a recorded flight, so that a replay lets it happen then again."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from aerodaas.recording.reader import Record, Recording
from aerodaas.status import Heard

__all__ = ["NEVER", "Pace", "later", "read_pace"]

NEVER = 2**63 - 1
"""A stamp that does not come."""


@dataclass(frozen=True)
class Pace:
    """Mission times, in nanoseconds and in order, of what a flight has done; empty for a new one.

    What a recording tells nothing of happens as in any other flight.
    """

    readings: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Frames and other measurements, by stream."""
    turns: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Of the setpoint loop, by robot."""
    plans: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Turns at which a plan had come from the trajectory scheduler, by robot."""
    heard: dict[str, tuple[Heard, ...]] = field(default_factory=dict)
    """Navigation and commands that reached a mission by stream, by robot."""
    work: dict[str, dict[str, dict[int, int | None]]] = field(default_factory=dict)
    """What an analysis (by stream) worked on (by source and stamp), and the stamp of the vehicle's
    state that it went by, if by any."""


def later(stamps: tuple[int, ...], after: int) -> int:
    """The first of `stamps` later than `after`; NEVER if there is none."""
    place = bisect_right(stamps, after)
    return stamps[place] if place < len(stamps) else NEVER


class _Reading:
    """Gathers a recording's times, message by message."""

    def __init__(self) -> None:
        self.readings: dict[str, set[int]] = defaultdict(set)
        self.turns: dict[str, set[int]] = defaultdict(set)
        self.plans: dict[str, set[int]] = defaultdict(set)
        self.heard: dict[str, list[Heard]] = defaultdict(list)
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
            self.readings[stream].add(record.stamp)

    def result(self, record: Record) -> None:
        """Of an analysis; one without inputs measures something itself."""
        source = record.value["source"]
        if source == record.topic.strip("/").rpartition("/")[0]:
            self.readings[source].add(record.value["stamp"])

    def setpoint(self, record: Record) -> None:
        value = record.value
        robot = value["robot"]
        self.turns[robot].add(value["stamp"])
        if value.get("planned"):
            self.plans[robot].add(value["stamp"])
        self.heard[robot] += [
            Heard(one["stream"], one["source"], one["stamp"], one["at"])
            for one in value.get("heard", ())
        ]

    def latency(self, record: Record) -> None:
        value, stamp = record.value, record.captured
        if len(value["hops"]) == 1:
            self.readings[value["stream"]].add(stamp)
            return
        self.work[value["stream"]][value["source"]][stamp] = value["hops"][-1].get("state")


def read_pace(path: str | Path) -> Pace:
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
            readers[record.schema](record)
    return Pace(
        *(_sorted(stamps) for stamps in (found.readings, found.turns, found.plans)),
        {robot: tuple(heard) for robot, heard in found.heard.items()},
        {
            stream: {source: dict(states) for source, states in sources.items()}
            for stream, sources in found.work.items()
        },
    )


def _sorted(stamps: dict[str, set[int]]) -> dict[str, tuple[int, ...]]:
    return {name: tuple(sorted(times)) for name, times in stamps.items()}
