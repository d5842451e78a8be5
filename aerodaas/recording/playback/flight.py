"""A recorded flight as a page plays it, read in one pass."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.config.redaction import catalogue
from aerodaas.errors import AeroDaaSError
from aerodaas.messages.mission import Decision, MissionPlan
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.protocol.playback import RecordedOut
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import AnalyticsOut, StreamKind
from aerodaas.recording.decoding.limits import MAX_KEYS
from aerodaas.recording.pictures import (
    CALIBRATION_SCHEMA,
    DETECTIONS_SCHEMA,
    MOUNT_SCHEMA,
    picture_topics,
)
from aerodaas.recording.playback.frame_index import NAVIGATION_SCHEMA, Captures, FrameIndex
from aerodaas.recording.playback.track import Room, TrackBuilder
from aerodaas.recording.reader import Record, Recording
from aerodaas.recording.recorded_environment import allowed_content, recorded_content
from aerodaas.simulation.scenario import scenario_names

__all__ = ["DecisionSums", "read_flight"]

_ROW_SECONDS = 0.5
_MOST_ROWS = 12_000
"""Sums that are kept; beyond, every second one is left out."""
_OUTCOMES = frozenset({"done", "late", "timeout", "failed", "dropped"})
"""Names of `TaskOutcome`."""
_SCHEMAS = frozenset(
    f"aerodaas.{name}" for name in ("VehicleState", "MissionStatus", "Plan", "Alert", "Decision")
)
_EACH = 1000
"""Messages between two words on the progress."""


class DecisionSums:
    """Sums over the decisions up to each time, as a dispatcher reports them in flight."""

    def __init__(self) -> None:
        self._rows: list[AnalyticsOut] = []
        self._interval = _ROW_SECONDS
        self._outcomes: Counter[str] = Counter()
        self._places: Counter[str] = Counter()
        self._totals = {"qos_total": 0.0, "qoe_total": 0.0}
        self._last: float | None = None

    @property
    def rows(self) -> list[AnalyticsOut]:
        """The sums so far, the newest last."""
        if self._last is None or (self._rows and self._rows[-1].time >= self._last):
            return self._rows
        return [*self._rows, *self._row(self._last)]

    def add(self, decision: Decision) -> None:
        """Add one decision or outcome."""
        now, action = seconds(decision.stamp), decision.action
        if action == "drop":
            # A task that its scheduler gives up ends by that.
            self._outcomes["dropped"] += 1
        elif action in _OUTCOMES:
            self._outcomes[action] += 1
            # An outcome's reason begins with where the task ran.
            self._places[decision.reason.partition(":")[0]] += 1
        else:
            return
        figures = decision.values
        self._totals |= {name: figures[name] for name in self._totals if name in figures}
        if self._last is None or now >= self._last:
            self._last = now
        if not self._rows or now >= self._rows[-1].time + self._interval:
            self._rows += self._row(now)
        if len(self._rows) > _MOST_ROWS:
            self._interval *= 2
            del self._rows[1::2]

    def _row(self, time: float) -> list[AnalyticsOut]:
        values = {"outcomes": self._outcomes, "places": self._places, **self._totals}
        row = AnalyticsOut.of(time, values)
        return [] if row is None else [row]


def read_flight(
    recording: Recording, tell: Callable[[float], None] = lambda _: None
) -> tuple[RecordedOut, FrameIndex]:
    """Read an open recording, which the frame index goes on reading.

    Args:
        recording: The recording.
        tell: Called with the share that has been read, 0 to 1.
    """
    return _Reading(recording).flight(tell)


class _Reading:
    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._room = Room()
        self._robots: dict[str, TrackBuilder] = {}
        self._alerts: list[Alert] = []
        self._sums = DecisionSums()
        known = recording.topics
        pictures = picture_topics(recording)[:MAX_KEYS]
        found = sorted(n for n, one in known.items() if one.schema == DETECTIONS_SCHEMA)[:MAX_KEYS]
        flown = sorted(n for n, one in known.items() if one.schema == NAVIGATION_SCHEMA)[:MAX_KEYS]
        self._pictures = _streams(pictures, "/image")
        self._mounts = _mounts(recording, self._pictures)
        mounts = [mount for _, mount in self._mounts.values()]
        self._captures = {name: Captures() for name in (*pictures, *found, *flown, *mounts)}
        self._found = _streams(found, "/detections")
        self._flown = _streams(flown, "/navigation")
        self._told = [name for name, one in known.items() if one.schema in _SCHEMAS]
        self._span = [0, 0]

    def flight(self, tell: Callable[[float], None]) -> tuple[RecordedOut, FrameIndex]:
        recording = self._recording
        whole = recording.duration * NANOSECONDS or 1.0
        first: int | None = None
        last = 0
        topics = {*self._told, *self._captures}
        for number, record in enumerate(recording.records(topics=topics, bare=self._captures)):
            if first is None:
                first = record.stamp
            last = record.stamp
            if number % _EACH == 0:
                tell(min(1.0, max(0.0, (last - first) / whole)))
            captures = self._captures.get(record.topic)
            if captures is not None:
                captures.add(record.captured, record.stamp)
            else:
                self._on_record(record)
        for captures in self._captures.values():
            captures.sort()
        mounts = {
            name: (calibration, mount, self._captures[mount])
            for name, (calibration, mount) in self._mounts.items()
        }
        pictures, found, flown = map(self._named, (self._pictures, self._found, self._flown))
        frames = FrameIndex(recording, pictures, found, flown, mounts)
        return self._told_of(first or 0, last), frames

    def _named(self, streams: dict[str, str]) -> dict[str, tuple[str, Captures]]:
        return {name: (topic, self._captures[topic]) for name, topic in streams.items()}

    def _on_record(self, record: Record) -> None:
        message = record.value
        if isinstance(message, Alert):
            if self._room.reserve(1):
                self._alerts.append(Alert(message.header, message.kind, message.text))
        elif isinstance(message, Decision):
            self._sums.add(message)
        elif (robot := self._robot(record.labels.robot)) is not None:
            if isinstance(message, VehicleState):
                robot.add_state(message)
            elif isinstance(message, MissionPlan):
                robot.add_plan(message)
            else:
                robot.add_status(message, record.labels.ahead)

    def _robot(self, name: str) -> TrackBuilder | None:
        known = self._robots.get(name)
        if known is None:
            if len(self._robots) >= MAX_KEYS:
                self._room.untold += 1
                return None
            known = self._robots[name] = TrackBuilder(self._room)
        return known

    def _told_of(self, first: int, last: int) -> RecordedOut:
        recording = self._recording
        captures = [self._captures[topic].captured for topic in self._pictures.values()]
        pictured = [seconds(one[0]) for one in captures if one]
        return RecordedOut(
            name=recording.provenance.get("name") or recording.path.stem,
            began=seconds(recording.epoch_ns),
            begin=max(0.0, seconds(first)),
            end=seconds(last),
            pictured=min(pictured, default=None),
            remark=_remark(recording, last, self._room.untold),
            **_surroundings(recording),
            tracks={name: one.track for name, one in self._robots.items()},
            alerts=sorted(self._alerts, key=lambda one: one.header.stamp),
            analytics=self._sums.rows,
            streams={
                **dict.fromkeys(self._pictures, StreamKind.PICTURES),
                **dict.fromkeys(self._found, StreamKind.DETECTIONS),
                **dict.fromkeys(self._flown, StreamKind.NAVIGATION),
            },
        )


def _streams(topics: list[str], kind: str) -> dict[str, str]:
    """Topics by the name of their stream; by their own where two streams have the same."""
    found: dict[str, str] = {}
    for topic in topics:
        name = topic.strip("/").removesuffix(kind)
        found[topic if name in found or not name else name] = topic
    return found


def _mounts(recording: Recording, pictures: dict[str, str]) -> dict[str, tuple[str, str]]:
    """Topics of calibration and mount of each stream of pictures that has both."""
    known = recording.topics
    found = {}
    for name, topic in pictures.items():
        stream = topic.removesuffix("/image")
        wanted = {f"{stream}/calibration": CALIBRATION_SCHEMA, f"{stream}/mount": MOUNT_SCHEMA}
        if all(one in known and known[one].schema == schema for one, schema in wanted.items()):
            calibration, mount = wanted
            found[name] = calibration, mount
    return found


def _remark(recording: Recording, last: int, untold: int) -> str:
    parts = []
    if not recording.complete:
        parts.append(f"it breaks off at {seconds(last):.1f} s")
    if recording.damaged:
        parts.append(f"{recording.damaged} damaged parts were left out")
    if untold:
        parts.append(f"{untold} changes, more than a page has room for, were left out")
    return "; ".join(parts)


def _surroundings(recording: Recording) -> dict[str, Any]:
    """The recorded environment as anybody may know it, and what it looks like, if there is one."""
    try:
        recorded = recorded_content(recording)
        content = allowed_content(recorded)
        config = validated(content, f"the environment in {recording.path}")
    except AeroDaaSError:
        return {"environment": {}}
    shown = catalogue(config).model_dump(mode="json", by_alias=True)
    return {"environment": shown, "scenery": _scenery(recorded, config)}


def _scenery(recorded: Any, config: EnvironmentConfig) -> SceneryOut:  # noqa: ANN401 - JSON
    """Of a world that ships: another one is a file's path, which a stranger may have chosen."""
    simulation = recorded.get("simulation")
    world = simulation.get("world") if isinstance(simulation, dict) else None
    if world not in scenario_names():
        return SceneryOut()
    named = config.simulation.model_copy(update={"world": world})
    return SceneryOut.of(config.model_copy(update={"simulation": named}))
