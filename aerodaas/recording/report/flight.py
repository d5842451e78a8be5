"""Flight data of a recording as arrays, for reports, comparisons and notebooks."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import seconds
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import Decision, MissionStatus, SetpointRecord
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.messages.vitals import Vitals
from aerodaas.recording.decoding.limits import MAX_KEYS
from aerodaas.recording.messages import Latency
from aerodaas.recording.reader import Record, Recording

__all__ = [
    "Band",
    "Load",
    "RecordedDecision",
    "RecordedDetection",
    "RecordedFlight",
    "RobotFlight",
    "StreamLatency",
]

_MOST_GPUS = 64
"""Of one machine."""
Floats = NDArray[np.float64]
V = TypeVar("V")


class _FullError(Exception):
    """More keys than a report tells apart."""


class _Table(defaultdict[str, V]):
    """A table that is filled by whatever a recording names, up to `MAX_KEYS` names."""

    def __missing__(self, key: str) -> V:
        if len(self) >= MAX_KEYS:
            raise _FullError
        return super().__missing__(key)


@dataclass(frozen=True, slots=True)
class Band:
    """A mission state with its start and end in mission seconds."""

    state: str
    start: float
    end: float
    reason: str = ""


@dataclass(frozen=True, slots=True)
class RecordedDetection:
    """One object detected in one frame."""

    stamp: int
    """Capture time of the frame, mission nanoseconds."""
    source: str
    """The frame's camera."""
    label: str
    score: float


@dataclass(frozen=True, slots=True)
class RecordedDecision:
    """One decision of the analytics scheduler for a task, or the task's outcome."""

    time: float
    """Mission seconds."""
    analysis: str
    action: str
    """`edge`, `cloud`, `drop` and `retry` are decisions; others, such as `done`, outcomes."""


@dataclass
class Load:
    """Processor and memory use of a process or a machine over time."""

    time: list[float] = field(default_factory=list)
    """Mission seconds."""
    cpu: list[float] = field(default_factory=list)
    """Cores in use by a process; fraction of all cores, 0 to 1, of a machine."""
    memory: list[float] = field(default_factory=list)
    """Megabytes of a process; fraction, 0 to 1, of a machine."""

    def add(self, time: float, cpu: float, memory: float) -> None:
        """Add a reading.

        Args:
            time: Mission seconds.
            cpu: Cores in use by a process; fraction of all cores, 0 to 1, of a machine.
            memory: Megabytes of a process; fraction, 0 to 1, of a machine.
        """
        self.time.append(time)
        self.cpu.append(cpu)
        self.memory.append(memory)


@dataclass
class RobotFlight:
    """Recorded flight of one robot: states, mission states, plan and geofence."""

    states: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    """Mission seconds, east, north and up in metres, battery 0 to 1."""
    truth: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Mission seconds, true east, north and up in metres, of a simulated drone."""
    bands: list[Band] = field(default_factory=list)
    plan: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """All waypoints planned during the flight, by id, local ENU metres."""
    visited: tuple[str, ...] = ()
    visits: int = 0
    """How often a waypoint was reached."""
    given_up: tuple[str, ...] = ()
    distance: float = 0.0
    """Metres flown, from the mission status."""
    fence: list[tuple[float, float]] = field(default_factory=list)
    clipped: Counter[str] = field(default_factory=Counter)
    """Number of setpoints changed by a limit, by limit."""
    clipped_at: dict[str, float] = field(default_factory=dict)
    """Mission seconds of the first setpoint changed by a limit, by limit."""
    _array: Floats = field(
        default_factory=lambda: np.empty((0, 5)), init=False, repr=False, compare=False
    )
    """The states as an array, as far as one has been asked for."""

    @property
    def time(self) -> Floats:
        """Mission seconds of the states, shape (N,)."""
        return self._columns[:, 0]

    @property
    def position(self) -> Floats:
        """Position in local ENU metres, shape (N, 3)."""
        return self._columns[:, 1:4]

    @property
    def battery(self) -> Floats:
        """Battery charge, 0 to 1, shape (N,)."""
        return self._columns[:, 4]

    @property
    def outcome(self) -> str:
        """The mission's last state and its reason."""
        if not self.bands:
            return "unknown: no mission was recorded"
        last = self.bands[-1]
        return f"{last.state}: {last.reason}" if last.reason else last.state

    def state_at(self, time: Floats) -> list[str]:
        """Mission state at each of these mission seconds."""
        if not self.bands:
            return [""] * len(time)
        starts = [band.start for band in self.bands]
        places = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, None)
        return [self.bands[place].state for place in places]

    @property
    def _columns(self) -> Floats:
        # Plots ask for it at each waypoint, and an hour has 72,000 states.
        if len(self._array) != len(self.states):
            self._array = np.array(self.states, dtype=np.float64).reshape(-1, 5)
            self._array.flags.writeable = False
        return self._array


@dataclass
class StreamLatency:
    """Latencies of the messages of one stream, in milliseconds; but for `age`, of the host."""

    total: list[float] = field(default_factory=list)
    """From capture to publishing."""
    age: list[float] = field(default_factory=list)
    """The same in mission time, of results; 0 in simulated time without simulated executions."""
    overhead: list[float] = field(default_factory=list)
    """The part of `total` without computation: transport between nodes and queueing."""
    wait: dict[str, list[float]] = field(default_factory=lambda: _Table(list))
    """From the previous node's publishing to this one's receiving, by node."""
    work: dict[str, list[float]] = field(default_factory=lambda: _Table(list))
    """From receiving to publishing, by node."""


@dataclass
class RecordedFlight:
    """All flight data of a recording except the images."""

    robots: dict[str, RobotFlight] = field(default_factory=lambda: _Table(RobotFlight))
    latencies: dict[str, StreamLatency] = field(default_factory=lambda: _Table(StreamLatency))
    """Latencies by stream."""
    frames: Counter[str] = field(default_factory=Counter)
    """Number of frames by camera."""
    frame_stamps: dict[str, list[int]] = field(default_factory=lambda: _Table(list))
    """Capture times of the frames in mission nanoseconds, by camera."""
    sightings: list[RecordedDetection] = field(default_factory=list)
    detections: Counter[str] = field(default_factory=Counter)
    """Number of detections by label."""
    decisions: Counter[str] = field(default_factory=Counter)
    """Number of scheduler decisions and outcomes by action."""
    outcomes: list[RecordedDecision] = field(default_factory=list)
    reasons: Counter[tuple[str, str]] = field(default_factory=Counter)
    """Number of scheduler decisions and outcomes by action and reason."""
    utility: dict[str, float] = field(default_factory=dict)
    """Utility gained by the analytics scheduler: `QoS`, and `QoE`, the bonuses of its windows."""
    loads: dict[str, Load] = field(default_factory=lambda: _Table(Load))
    """Load by actor."""
    machines: dict[str, Load] = field(default_factory=lambda: _Table(Load))
    """Load by machine."""
    gpus: dict[str, Load] = field(default_factory=lambda: _Table(Load))
    """Load of GPUs by machine and number, in the units of a machine's."""
    alerts: list[tuple[float, str, str]] = field(default_factory=list)
    """Mission seconds, kind, text."""
    drops: dict[str, int] = field(default_factory=dict)
    """Number of messages lost before the recorder, by stream."""
    untold: int = 0
    """Number of messages left out, because more than `MAX_KEYS` names were met."""

    @classmethod
    def read(cls, recording: Recording) -> RecordedFlight:
        """Read an open recording in one pass; fields without recorded data stay empty."""
        flight = cls()
        for record in recording.records(schemas=_READERS):
            flight._enter(record)
        for robot in flight.robots.values():
            robot.bands = list(_closed(robot))
        return flight

    def _enter(self, record: Record) -> None:
        try:
            _READERS[record.schema](self, record)
        except _FullError:
            self.untold += 1


def _closed(robot: RobotFlight) -> Iterator[Band]:
    """Bands extended to the start of the next one, the last to the last vehicle state."""
    ends = [band.start for band in robot.bands[1:]]
    if robot.bands:
        last = robot.states[-1][0] if robot.states else 0.0
        ends.append(max(last, robot.bands[-1].end))
    for band, end in zip(robot.bands, ends, strict=True):
        yield replace(band, end=end)


def _state(flight: RecordedFlight, record: Record) -> None:
    state: VehicleState = record.value
    place = map(float, state.odometry.position)
    robot, now = flight.robots[record.labels.robot], seconds(state.stamp)
    robot.states.append((now, *place, state.battery.fraction))  # type: ignore[arg-type]
    if state.truth is not None:
        robot.truth.append((now, *map(float, state.truth.position)))  # type: ignore[arg-type]


def _mission(flight: RecordedFlight, record: Record) -> None:
    status: MissionStatus = record.value
    robot = flight.robots[record.labels.robot]
    now, state = seconds(status.stamp), status.state.value
    if not robot.bands or robot.bands[-1].state != state:
        robot.bands.append(Band(state, now, now, status.reason))
    else:
        last = robot.bands[-1]
        robot.bands[-1] = Band(last.state, last.start, now, status.reason or last.reason)
    if status.visits > robot.visits:
        robot.visited = (*robot.visited, *status.visited[robot.visits - status.visits :])
        robot.visits = status.visits
    robot.given_up = tuple(dict.fromkeys((*robot.given_up, *status.given_up)))
    robot.distance = status.distance


def _plan(flight: RecordedFlight, record: Record) -> None:
    robot = flight.robots[record.labels.robot]
    for waypoint in record.value.waypoints:
        robot.plan[waypoint.id] = (waypoint.x, waypoint.y, waypoint.z)


def _fence(flight: RecordedFlight, record: Record) -> None:
    flight.robots[record.labels.robot].fence = record.value.polygon


def _setpoint(flight: RecordedFlight, record: Record) -> None:
    setpoint: SetpointRecord = record.value
    robot, now = flight.robots[record.labels.robot], seconds(setpoint.stamp)
    robot.clipped.update(setpoint.clipped_by)
    for limit in setpoint.clipped_by:
        robot.clipped_at.setdefault(limit, now)


def _latency(flight: RecordedFlight, record: Record) -> None:
    told: Latency = record.value
    if len(told.hops) == 1:
        return
    latency = flight.latencies[told.stream]
    latency.total.append(told.total_ms)
    if not told.empty:
        latency.age.append((record.stamp - record.captured) / 1e6)
    for hop in told.hops:
        latency.wait[hop.node].append(hop.wait_ms)
        latency.work[hop.node].append(hop.work_ms)
    latency.overhead.append(sum(hop.wait_ms for hop in told.hops))


def _frame(flight: RecordedFlight, record: Record) -> None:
    header: Header = record.value.header
    flight.frame_stamps[header.source].append(header.stamp)
    flight.frames[header.source] += 1


def _detections(flight: RecordedFlight, record: Record) -> None:
    found: Detections = record.value
    header = found.header
    flight.detections.update(item.label for item in found)
    flight.sightings.extend(
        RecordedDetection(header.stamp, header.source, item.label, item.score) for item in found
    )


def _decision(flight: RecordedFlight, record: Record) -> None:
    found: Decision = record.value
    flight.decisions[found.action] += 1
    flight.reasons[found.action, found.reason] += 1
    totals = {"QoS": "qos_total", "QoE": "qoe_total"}
    values = found.values
    flight.utility |= {name: values[key] for name, key in totals.items() if key in values}
    analysis = found.task.rpartition("#")[0]
    flight.outcomes.append(RecordedDecision(seconds(found.stamp), analysis, found.action))


def _alert(flight: RecordedFlight, record: Record) -> None:
    alert: Alert = record.value
    flight.alerts.append((seconds(alert.header.stamp), alert.kind, alert.text))


def _drops(flight: RecordedFlight, record: Record) -> None:
    flight.drops[record.value.stream] = record.value.total


def _vitals(flight: RecordedFlight, record: Record) -> None:
    vitals: Vitals = record.value
    labels, now = record.labels, seconds(record.stamp)
    if labels.cpu_cores is not None:
        flight.loads[labels.actor].add(now, labels.cpu_cores, vitals.memory / 1e6)
    machine = flight.machines[labels.machine]
    # Every actor of a machine reports the machine's load; one reading per moment is enough.
    if not machine.time or now > machine.time[-1]:
        machine.add(now, vitals.machine_cpu, vitals.machine_memory)
        for number, gpu in enumerate(vitals.gpus[:_MOST_GPUS]):
            flight.gpus[f"{labels.machine} {number}"].add(now, gpu.busy, gpu.memory)


_READERS: dict[str, Callable[[RecordedFlight, Record], None]] = {
    "aerodaas.VehicleState": _state,
    "aerodaas.MissionStatus": _mission,
    "aerodaas.Plan": _plan,
    "aerodaas.Geofence": _fence,
    "aerodaas.Setpoint": _setpoint,
    "aerodaas.Latency": _latency,
    "aerodaas.Frame": _frame,
    "aerodaas.Detections": _detections,
    "aerodaas.Decision": _decision,
    "aerodaas.Alert": _alert,
    "aerodaas.Drops": _drops,
    "aerodaas.Vitals": _vitals,
}
