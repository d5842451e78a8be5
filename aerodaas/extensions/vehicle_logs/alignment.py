"""Laying a vehicle's log over the mission clock, and telling whether it is of the same flight."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from typing_extensions import Self

from aerodaas.clock import seconds
from aerodaas.errors import RecordingError, UnknownIdError
from aerodaas.extensions.vehicle_logs.log import Floats, VehicleLog
from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.reader import Recording

__all__ = [
    "Alignment",
    "RecordedClock",
    "align",
    "fit_clock_line",
    "recorded_clocks",
    "robot_of",
    "starts_of",
]

_MOST = 400
"""Pairs of which a line is made: of all pairs among them, a slope each."""
_SHORTEST = 10.0
"""Seconds below which two clocks' drift cannot be told from the stamps' own errors."""
_STRAIGHT, _STRAIGHT_SHARE = 1.0, 0.75
"""Seconds beside a line within which a pair lies on it, and the share of pairs that have to."""
_BACK = 1.0
"""Seconds by which a clock reads less than before only after a restart."""
_SURE = 95
"""Percent of the pairs within the error."""
_OVERLAP = 1.0
"""Seconds that a log and a recording have in common at least."""
_MOST_STARTS = 100
"""Starts of an autopilot in a recording: each is compared with all of the log."""
_MOVING = 0.5
"""Metres a second from which a state tells by its motion whose it is."""
_ROUND = 2**32 / 1e3
"""Seconds after which time_boot_ms begins anew, which has 32 bits."""
_ENOUGH = 20
"""Such states, of a second or so, from which a judgement is made."""
_STRANGE = 0.5
"""Share of the recorded motion's square that the log's is beside it, from which it is another's:
of the same flight it is a few hundredths, of two unrelated ones it is 1 or more."""


@dataclass(frozen=True, slots=True)
class ClockLine:
    """Autopilot's seconds = `offset` + `rate` * mission seconds."""

    offset: float
    """What the autopilot's clock read at second 0 of the mission."""
    rate: float
    """Seconds of the autopilot's clock in one of the mission's."""
    error: float
    """Seconds by which a moment may be wrong: within them are 95 % of the pairs on the line; with
    TIMESYNC's own error."""
    synchronised: bool
    """Whether the pairs come from TIMESYNC. If not, the link's delay comes on top of the error."""

    @property
    def drift(self) -> float:
        """Parts per million by which the autopilot's clock is fast."""
        return 1e6 * (self.rate - 1.0)

    def mission_time(self, autopilot: Floats) -> Floats:
        """Mission seconds of seconds of the autopilot's clock."""
        return (autopilot - self.offset) / self.rate

    def __str__(self) -> str:
        delay = "" if self.synchronised else ", and late by the link's delay (it told no TIMESYNC)"
        return (
            f"clocks {self.offset:+.3f} s apart, drifting by {self.drift:+.0f} ppm, "
            f"within {1e3 * self.error:.0f} ms{delay}"
        )


def starts_of(pairs: Floats) -> list[Floats]:
    """The pairs of each start of the autopilot, in order: its clock begins anew with each."""
    back = np.flatnonzero(np.diff(pairs[:, 1]) < -_BACK) + 1
    return np.split(pairs, back)


def fit_clock_line(pairs: Floats) -> ClockLine:
    """Lay a line through pairs by Theil and Sen: the median of all slopes, then of all offsets.

    Up to a quarter of the pairs may be anywhere (Theil 1950, Sen 1968).

    Args:
        pairs: Mission seconds, autopilot's seconds and error (NaN: not by TIMESYNC) of one start of
            the autopilot, shape (N, 3), N at least 1. Pairs by TIMESYNC are preferred.

    Raises:
        RecordingError: If the pairs are on no line.
    """
    known = np.isfinite(pairs[:, 2])
    synchronised = bool(known.any())
    if synchronised:
        pairs = pairs[known]
        pairs = pairs[pairs[:, 2] <= 2.0 * np.median(pairs[:, 2])]
    pairs = pairs[np.linspace(0, len(pairs) - 1, min(_MOST, len(pairs))).astype(int)]
    mission, autopilot = pairs[:, 0], pairs[:, 1]
    span = float(np.ptp(mission))
    rate = 1.0
    if span >= _SHORTEST:
        apart = mission[:, None] - mission[None, :]
        far = apart > span / 4.0
        rate = float(np.median((autopilot[:, None] - autopilot[None, :])[far] / apart[far]))
    offset = float(np.median(autopilot - rate * mission))
    beside = np.abs(autopilot - offset - rate * mission)
    near = beside[beside <= _STRAIGHT]
    if rate <= 0.0 or len(near) < _STRAIGHT_SHARE * len(beside):
        raise RecordingError(
            "the autopilot's clock in the recording runs on no line "
            f"({np.median(beside):.1f} s beside it): no log can be laid over it"
        )
    own = float(np.median(pairs[:, 2])) if synchronised else 0.0
    return ClockLine(offset, rate, float(np.percentile(near, _SURE)) + own, synchronised)


@dataclass
class RecordedClock:
    """Clock, motion and arming of one robot's autopilot, as recorded."""

    pairs: list[tuple[float, float, float]] = field(default_factory=list)
    """Mission seconds, the autopilot's seconds, error in seconds (NaN: not by TIMESYNC)."""
    motion: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Mission seconds, velocity east, north, up in m/s."""
    armed: list[float] = field(default_factory=list)
    """Mission seconds of the states with motors armed."""

    def add_state(self, state: VehicleState) -> None:
        """Add a vehicle's state."""
        now = seconds(state.stamp)
        clock = state.extra.get("autopilot_time", np.nan)
        if np.isfinite(clock):
            self.pairs.append((now, clock, state.extra.get("autopilot_time_error", np.nan)))
        self.motion.append((now, *state.odometry.velocity.tolist()))  # type: ignore[arg-type]
        if state.armed:
            self.armed.append(now)

    @property
    def flown(self) -> tuple[float, float]:
        """First and last mission second with motors armed; of the recording if there is none."""
        moments = self.armed or [moment for moment, *_ in self.motion] or [0.0]
        return moments[0], moments[-1]


@dataclass(frozen=True, slots=True)
class Alignment:
    """How a log lies over a recording."""

    clock: ClockLine
    begin: float
    """Mission seconds of the log's first and last moments."""
    end: float
    flown: tuple[float, float]
    """Mission seconds of the flight in the recording."""
    compared: bool
    """Whether the motion was compared; if not, the clocks alone tell that it is the same flight."""

    @classmethod
    def of(
        cls, log: VehicleLog, clock: ClockLine, flown: tuple[float, float], *, compared: bool
    ) -> Self:
        """Lay the ends of a log over the mission clock.

        Args:
            log: The log.
            clock: The autopilot's clock by mission time.
            flown: Beginning and end of the flight in the recording, mission seconds.
            compared: Whether the motion was compared, and not the clocks alone.
        """
        begin, end = clock.mission_time(np.array(log.span))
        return cls(clock, float(begin), float(end), flown, compared)

    def __str__(self) -> str:
        begin, end = self.flown
        short = (
            ""
            if self.begin <= begin and self.end >= end
            else (f", of the flight from {begin:.1f} to {end:.1f} s")
        )
        alone = (
            "" if self.compared else "; compared by clocks alone, for hardly any motion is in both"
        )
        span = f"{self.begin:.1f} to {self.end:.1f} s of the mission{short}"
        return f"covers {span}; {self.clock}{alone}"


def recorded_clocks(recording: Recording) -> dict[str, RecordedClock]:
    """Read what a recording tells of each robot's autopilot, by robot."""
    clocks: dict[str, RecordedClock] = {}
    for record in recording.records(schemas=("aerodaas.VehicleState",)):
        clocks.setdefault(record.labels.robot, RecordedClock()).add_state(record.value)
    return clocks


def robot_of(clocks: dict[str, RecordedClock], robot: str | None) -> str:
    """The robot whose log is meant: the only one with a clock, where none is named.

    Args:
        clocks: Clocks of the recording by robot.
        robot: Id of the robot; None for the only one with a clock.

    Raises:
        UnknownIdError: If there is no such robot in the recording.
        RecordingError: If it has no clock of an autopilot, or several have and none is named.
    """
    if robot is not None and robot not in clocks:
        raise UnknownIdError("robot in the recording", robot, list(clocks))
    timed = [name for name, one in clocks.items() if one.pairs and robot in {None, name}]
    if len(timed) == 1:
        return timed[0]
    if timed:
        raise RecordingError(
            f"the recording has several autopilots ({', '.join(timed)}): say whose log it is by "
            "--robot"
        )
    raise RecordingError(
        "the recording holds no clock of an autopilot (autopilot_time), by which a log is laid "
        "over it; only flights by the driver mavlink do"
    )


def align(log: VehicleLog, recorded: RecordedClock) -> Alignment:
    """Lay a log over the mission clock.

    Args:
        log: The log.
        recorded: The robot's clock and motion, with a pair at least.

    Raises:
        RecordingError: If they have no time in common, or the motion is another's; or if the
            autopilot was started more often than any is.
    """
    pairs, motion = np.array(recorded.pairs), np.array(recorded.motion)
    found: list[tuple[float, Alignment]] = []
    starts = starts_of(pairs)
    if len(starts) > _MOST_STARTS:
        raise RecordingError(
            "cannot be laid over the recording, in which the autopilot's clock began "
            f"{len(starts)} times, more than {_MOST_STARTS}: no flight does"
        )
    for start in starts:
        clock = _within_days(fit_clock_line(start), log)
        begin, end = clock.mission_time(np.array(log.span))
        if min(end, start[-1, 0]) - max(begin, start[0, 0]) < _OVERLAP:
            continue
        within = motion[(motion[:, 0] >= start[0, 0]) & (motion[:, 0] <= start[-1, 0])]
        strange = _strangeness(log, clock, within)
        told = Alignment.of(log, clock, recorded.flown, compared=strange is not None)
        found.append((0.0 if strange is None else strange, told))
    if not found:
        raise RecordingError(
            f"is of another flight: it runs from second {log.span[0]:.0f} to {log.span[1]:.0f} of "
            f"the autopilot's clock, the recording {_spans(starts)}; {_REMEDY}"
        )
    strange, best = min(found, key=lambda one: one[0])
    if strange > _STRANGE:
        raise RecordingError(
            "is of another flight: at the same seconds of the autopilot's clock its speeds are not "
            f"those of the recording; {_REMEDY}"
        )
    return best


def _within_days(clock: ClockLine, log: VehicleLog) -> ClockLine:
    """`clock`, whole rounds of time_boot_ms later where that is all that the autopilot told.

    Simulated PX4s count from 1970, of which TIMESYNC's answers are no readings since a start.
    """
    if clock.synchronised:
        return clock
    rounds = round((log.span[0] - clock.offset) / _ROUND)
    return replace(clock, offset=clock.offset + rounds * _ROUND)


_REMEDY = "give the one of this flight (aerodaas logs list ROBOT lists them with their times)"


def _spans(starts: Iterable[Floats]) -> str:
    return " and ".join(f"from {one[:, 1].min():.0f} to {one[:, 1].max():.0f}" for one in starts)


def _strangeness(log: VehicleLog, clock: ClockLine, motion: Floats) -> float | None:
    """How much of the recorded motion's square the log's is beside it; None for hardly any."""
    velocity = log.topics.get("velocity")
    if velocity is None or len(velocity.time) == 0:
        return None
    order = np.argsort(velocity.time)
    times = clock.mission_time(velocity.time[order])
    inside = (motion[:, 0] >= times[0]) & (motion[:, 0] <= times[-1])
    told = np.column_stack(
        [np.interp(motion[:, 0], times, velocity.columns[axis][order]) for axis in _AXES]
    )
    speeds = np.fmax(np.linalg.norm(told, axis=1), np.linalg.norm(motion[:, 1:], axis=1))
    used = inside & (speeds >= _MOVING) & np.isfinite(told).all(1) & np.isfinite(motion).all(1)
    if used.sum() < _ENOUGH:
        return None
    beside = np.square(told[used] - motion[used, 1:]).sum()
    return float(beside / max(np.square(motion[used, 1:]).sum(), np.square(told[used]).sum()))


_AXES = ("east", "north", "up")
