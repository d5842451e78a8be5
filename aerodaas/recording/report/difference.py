"""Differences between two recordings of the same sensors.

Compares detections, navigation, other results, decisions, mission states, setpoints and alerts.
Results are paired by the measurement that they were computed from, not by their time of arrival.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Hashable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from aerodaas.recording.reader import Record, Recording
from aerodaas.recording.report.detection_diff import DetectionDiff, box_shift

__all__ = ["Difference", "StreamDifference", "difference"]

_TURN = 50_000_000
"""Nanoseconds between cycles of the setpoint loop."""

Key = Hashable
Content = Any


@dataclass(frozen=True, slots=True)
class StreamDifference:
    """Comparison of one stream in both recordings."""

    what: str
    """Stream and kind of data, such as `scheduler decisions`."""
    same: int
    differing: int
    """Number of results of the same measurement with different content."""
    only_first: int
    only_second: int
    example: str = ""
    """Description of the first difference; empty for none."""
    boxes: DetectionDiff | None = None
    """Changes of the boxes, for detections that differ."""

    @property
    def agrees(self) -> bool:
        """Whether nothing differs."""
        return not (self.differing or self.only_first or self.only_second)

    def __str__(self) -> str:
        """One readable line."""
        if self.agrees:
            return f"{self.what}: {self.same}, all the same"
        text = f"{self.what}: {self.same} the same, {self.differing} differ"
        if self.only_first or self.only_second:
            text += f", {self.only_first} only in the first, {self.only_second} only in the second"
        if self.boxes is not None:
            return f"{text}; {self.boxes}"
        return f"{text}; first: {self.example}" if self.example else text


@dataclass(frozen=True, slots=True)
class Difference:
    """Comparison of all streams of two recordings."""

    streams: tuple[StreamDifference, ...] = field(default=())

    @property
    def agrees(self) -> bool:
        """Whether no stream differs."""
        return all(stream.agrees for stream in self.streams)

    def as_dict(self) -> dict[str, Any]:
        """All fields as a dictionary, for JSON."""
        return {"agrees": self.agrees, "streams": [asdict(stream) for stream in self.streams]}

    def __str__(self) -> str:
        """A line for each stream, and the verdict."""
        verdict = "every decision is the same" if self.agrees else "the decisions differ"
        return "\n".join([*(f"  {stream}" for stream in self.streams), verdict])


def difference(first: str | Path, second: str | Path) -> Difference:
    """Compare two recordings.

    Results of measurements later than the first recording's last setpoint are left out: they
    affected no decision.

    Args:
        first: The first MCAP file.
        second: The second MCAP file.

    Returns:
        The differences by stream.

    Raises:
        RecordingError: If a recording cannot be read.
    """
    end = _last_turn(first)
    one, other = _contents(first, end), _contents(second, end)
    return Difference(
        tuple(
            _compare(what, one.get(what, {}), other.get(what, {}))
            for what in dict.fromkeys([*one, *other])
        )
    )


def _last_turn(path: str | Path) -> int | None:
    with Recording.open(path) as recording:
        turns = recording.records(schemas=("aerodaas.Setpoint",))
        return max((record.value["stamp"] for record in turns), default=None)


def _contents(path: str | Path, end: int | None) -> dict[str, dict[Key, Content]]:
    """Compared contents up to mission time `end`, by stream and pairing key."""
    found: dict[str, dict[Key, Content]] = defaultdict(dict)
    states: dict[str, list[str]] = defaultdict(list)
    with Recording.open(path) as recording:
        for record in recording.records(schemas=_READERS):
            if end is not None and record.value["stamp"] > end:
                continue
            if record.schema == "aerodaas.MissionStatus":
                robot, state = record.value["robot"], record.value["state"]
                if states[robot][-1:] == [state]:
                    continue
                states[robot].append(state)
            what, key, content = _READERS[record.schema](record)
            entries = found[what]
            if key in entries:
                # The same task decided twice, or two results of one measurement: keep the order.
                key = (key, sum(1 for known in entries if _base(known) == key))
            entries[key] = content
    return found


def _base(key: Key) -> Key:
    return key[0] if isinstance(key, tuple) and key and isinstance(key[0], tuple) else key


def _compare(what: str, one: dict[Key, Content], other: dict[Key, Content]) -> StreamDifference:
    common = [key for key in one if key in other]
    apart = [key for key in common if one[key] != other[key]]
    example = ""
    if apart:
        example = f"{_words(one[apart[0]])} became {_words(other[apart[0]])}"
    elif len(one) != len(other) or len(common) != len(one):
        missing = [key for key in one if key not in other]
        extra = [key for key in other if key not in one]
        example = f"{_words(one[missing[0]])} is missing" if missing else ""
        example = example or (f"{_words(other[extra[0]])} is new" if extra else "")
    pairs = [(one[key], other[key]) for key in apart]
    return StreamDifference(
        what,
        same=len(common) - len(apart),
        differing=len(apart),
        only_first=len(one) - len(common),
        only_second=len(other) - len(common),
        example=example,
        boxes=box_shift(pairs) if pairs and what.endswith("detections") else None,
    )


def _words(content: Content) -> str:
    text = content if isinstance(content, str) else json.dumps(content)
    longest = 100
    return text if len(text) <= longest else f"{text[:longest]} …"


def _detections(record: Record) -> tuple[str, Key, Content]:
    value = record.value
    stream = record.topic.removesuffix("/detections").strip("/")
    return f"{stream} detections", (value["source"], value["stamp"]), value["items"]


def _navigation(record: Record) -> tuple[str, Key, Content]:
    value = record.value
    stream = record.topic.removesuffix("/navigation").strip("/")
    content = {key: value[key] for key in ("type", "waypoints", "commands")}
    return f"{stream} navigation", (value["source"], value["stamp"]), content


def _value(record: Record) -> tuple[str, Key, Content]:
    value = record.value
    stream = record.topic.removesuffix("/value").strip("/")
    return f"{stream} results", (value["source"], value["stamp"]), value["value"]


def _decision(record: Record) -> tuple[str, Key, Content]:
    value = record.value
    return "scheduler decisions", (value["task"],), f"{value['action']} of {value['task']}"


def _mission(record: Record) -> tuple[str, Key, Content]:
    value = record.value
    text = f"{value['state']} at {value['stamp'] / 1e9:.3f} s ({value['reason']})"
    return f"{value['robot']} mission states", (value["stamp"],), text


def _setpoint(record: Record) -> tuple[str, Key, Content]:
    value = record.value
    # In real time the loop's cycles are a few milliseconds early or late.
    turn = round(value["stamp"] / _TURN)
    return f"{value['robot']} setpoints asked for", (turn,), value["asked"]


def _alert(record: Record) -> tuple[str, Key, Content]:
    value = record.value
    return "alerts", (value["source"], value["stamp"], value["kind"]), value["text"]


_READERS: dict[str, Callable[[Record], tuple[str, Key, Content]]] = {
    "aerodaas.Detections": _detections,
    "aerodaas.Navigation": _navigation,
    "aerodaas.Value": _value,
    "aerodaas.Decision": _decision,
    "aerodaas.MissionStatus": _mission,
    "aerodaas.Setpoint": _setpoint,
    "aerodaas.Alert": _alert,
}
