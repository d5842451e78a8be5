"""Differences between two recordings of the same sensors.

Compares detections, navigation, other results, decisions, mission states, setpoints and alerts.
Results are paired by the measurement that they were computed from, not by their time of arrival.
"""

from __future__ import annotations

import json
import statistics
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from aerodaas.geometry.frames import Box
from aerodaas.messages.detections import Detection
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import Decision, MissionState, MissionStatus
from aerodaas.messages.readings import Alert
from aerodaas.recording.encoding import plain
from aerodaas.recording.messages import NavigationRecord
from aerodaas.recording.reader import Record, Recording

__all__ = ["Difference", "box_shift", "difference"]

_OVERLAP = 0.5
"""Least intersection over union of two boxes of the same object, as in PASCAL VOC."""
_TURN = 50_000_000
"""Nanoseconds between cycles of the setpoint loop."""

Key = Hashable
Content = Any


@dataclass(frozen=True, slots=True)
class DetectionDiff:
    """Comparison of two results for the same frames, boxes paired by label and overlap."""

    paired: int
    lost: int
    """Number of objects that only the first result has."""
    new: int
    """Number of objects that only the second result has."""
    median_pixels: float
    """Median over the pairs of the largest distance between edges."""
    most_pixels: float
    most_score: float
    """Largest difference of a pair's scores."""

    def __str__(self) -> str:
        """One readable line."""
        text = f"{self.paired} objects found again, {self.lost} lost, {self.new} new"
        if not self.paired:
            return text
        return (
            f"{text}; boxes moved by {self.median_pixels:.1f} pixels (median, at most "
            f"{self.most_pixels:.1f}), scores by at most {self.most_score:.2f}"
        )


def box_shift(results: Iterable[tuple[Sequence[Detection], Sequence[Detection]]]) -> DetectionDiff:
    """Pair the objects of each frame's two results and measure their differences.

    Args:
        results: For each frame, both results.
    """
    moves, scores = [], []
    lost = new = 0
    for first, second in results:
        left = list(second)
        for item in first:
            match = max(left, key=lambda other: _likeness(item, other), default=None)
            if match is None or _likeness(item, match) < _OVERLAP:
                lost += 1
                continue
            left.remove(match)
            pairs = zip(item.box, match.box, strict=True)
            moves.append(max(abs(a - b) for a, b in pairs))
            scores.append(abs(item.score - match.score))
        new += len(left)
    return DetectionDiff(
        len(moves),
        lost,
        new,
        statistics.median(moves) if moves else 0.0,
        max(moves, default=0.0),
        max(scores, default=0.0),
    )


def _likeness(one: Detection, other: Detection) -> float:
    """Intersection over union; -1 for different labels."""
    return _overlap(one.box, other.box) if one.label == other.label else -1.0


def _overlap(one: Box, other: Box) -> float:
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    common = max(0.0, width) * max(0.0, height)
    whole = _area(one) + _area(other) - common
    return common / whole if whole > 0 else 0.0


def _area(box: Box) -> float:
    return max(0.0, box[2] - box[0]) * max(0.0, box[3] - box[1])


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
        return max((record.value.stamp for record in turns), default=None)


def _contents(path: str | Path, end: int | None) -> dict[str, dict[Key, Content]]:
    """Compared contents up to mission time `end`, by stream and pairing key."""
    found: dict[str, dict[Key, Content]] = defaultdict(dict)
    states: dict[str, MissionState] = {}
    with Recording.open(path) as recording:
        for record in recording.records(schemas=_READERS):
            if end is not None and _stamp(record.value) > end:
                continue
            if record.schema == "aerodaas.MissionStatus":
                robot, state = record.labels.robot, record.value.state
                if states.get(robot) is state:
                    continue
                states[robot] = state
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
    text = content if isinstance(content, str) else json.dumps(plain(content))
    longest = 100
    return text if len(text) <= longest else f"{text[:longest]} …"


def _stamp(message: Any) -> int:  # noqa: ANN401 - of a class of `_READERS`
    """Mission time of the measurement or of the event, nanoseconds."""
    stamp: int = message.header.stamp if hasattr(message, "header") else message.stamp
    return stamp


def _result(record: Record, what: str, kind: str, content: Content) -> tuple[str, Key, Content]:
    """Result that was computed from one measurement."""
    header: Header = record.value.header
    stream = record.topic.removesuffix(f"/{kind}").strip("/")
    return f"{stream} {what}", (header.source, header.stamp), content


def _detections(record: Record) -> tuple[str, Key, Content]:
    return _result(record, "detections", "detections", record.value.items)


def _navigation(record: Record) -> tuple[str, Key, Content]:
    found: NavigationRecord = record.value
    content = found.type, found.waypoints, found.commands
    return _result(record, "navigation", "navigation", content)


def _value(record: Record) -> tuple[str, Key, Content]:
    return _result(record, "results", "value", record.value.value)


def _decision(record: Record) -> tuple[str, Key, Content]:
    found: Decision = record.value
    return "scheduler decisions", (found.task,), f"{found.action} of {found.task}"


def _mission(record: Record) -> tuple[str, Key, Content]:
    status: MissionStatus = record.value
    text = f"{status.state.value} at {status.stamp / 1e9:.3f} s ({status.reason})"
    return f"{record.labels.robot} mission states", (status.stamp,), text


def _setpoint(record: Record) -> tuple[str, Key, Content]:
    # In real time the loop's cycles are a few milliseconds early or late.
    turn = round(record.value.stamp / _TURN)
    return f"{record.labels.robot} setpoints asked for", (turn,), record.value.asked


def _alert(record: Record) -> tuple[str, Key, Content]:
    alert: Alert = record.value
    return "alerts", (alert.header.source, alert.header.stamp, alert.kind), alert.text


_READERS: dict[str, Callable[[Record], tuple[str, Key, Content]]] = {
    "aerodaas.Detections": _detections,
    "aerodaas.Navigation": _navigation,
    "aerodaas.Value": _value,
    "aerodaas.Decision": _decision,
    "aerodaas.MissionStatus": _mission,
    "aerodaas.Setpoint": _setpoint,
    "aerodaas.Alert": _alert,
}
