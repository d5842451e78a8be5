"""Verdict of a rehearsed flight: each finding is a reason to refuse it, with figures and place."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.messages.mission import Place
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.protocol.proposals import ClearanceOut
from aerodaas.protocol.schemas import VerdictOut
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight, RobotFlight
from aerodaas.service.flights.orders import OtherLease
from aerodaas.service.rehearsal.clearance import ON_GROUND, clearances
from aerodaas.simulation.collision import CLEARANCE

__all__ = ["Finding", "findings_of", "judge", "together"]

_BOUNDARIES = {
    "geofence": "the fence",
    "ceiling": "the greatest height",
    "max_range": "the greatest range",
}
"""Limits of setpoints that are boundaries in space, by the names of `SetpointFilter`."""
_FAILURES = frozenset(
    {
        "actor_failed",
        "analysis_failed",
        "analysis_hung",
        "battery_critical",
        "battery_low",
        "command_failed",
        "failsafe",
        "motors_running",
        "no_position",
        "refused",
        "scheduler",
        "scheduler_failed",
        "unreachable_plan",
        "vehicle",
        "vehicle_lost",
        "wind",
    }
)
"""Kinds of alerts that tell of a failure; all others are an application's own results, or have a
finding of their own."""
_TRACK_POINTS = 160
_TRACK_STEP = 0.5
"""Least metres between two places of a track."""


@dataclass(frozen=True)
class Finding:
    """A reason to refuse a flight."""

    text: str
    """Event with its figures, and the remedy."""
    place: tuple[float, float] | None = None
    """Where it happened, metres east and north."""


def findings_of(
    flight: RecordedFlight,
    config: EnvironmentConfig,
    *,
    minutes: float,
    others: Sequence[OtherLease] = (),
    nearest: Iterable[ClearanceOut] = (),
) -> list[Finding]:
    """All reasons to refuse a flight; empty if there is none.

    Args:
        flight: The flight in simulation.
        config: Environment that it flew in.
        minutes: Of the lease.
        others: Areas of all other granted leases.
        nearest: Smallest distance of each robot from an object, see `clearances`.
    """
    found: list[Finding] = []
    known = {robot.id: robot for robot in config.robots}
    flown = [name for name in flight.robots if name in known and flight.robots[name].bands]
    if not flown:
        return [Finding("no drone has flown: navigate one in the mission")]
    for name in flown:
        found += _RobotFindings(known[name], flight.robots[name], minutes).all(others)
    found += _near_misses(nearest)
    found += _alerts(flight.alerts)
    return found


def _landing_time(robot: RobotFlight) -> float | None:
    """Mission seconds at which a robot had landed; None if it did not."""
    last = robot.bands[-1] if robot.bands else None
    return last.start if last is not None and last.state == "landed" else None


def _flown(flight: RobotFlight) -> NDArray[np.float64]:
    """Positions of a robot in the air, shape (N, 3)."""
    return flight.position[~np.isin(np.array(flight.state_at(flight.time)), ON_GROUND)]


def _track(flight: RobotFlight) -> list[Place]:
    """Way of a robot at `_TRACK_POINTS` places or fewer, as far apart as each other."""
    places = _flown(flight)
    places = places[np.isfinite(places).all(axis=1)]
    if not len(places):
        return []
    along = np.insert(np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1)), 0, 0.0)
    count = int(min(_TRACK_POINTS, 2 + along[-1] / _TRACK_STEP))
    kept = np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], count)))
    return [(x, y, z) for x, y, z in places[kept].round(1).tolist()]


class _RobotFindings:
    """Findings about one robot."""

    def __init__(self, robot: RobotConfig, flight: RobotFlight, minutes: float) -> None:
        self._id = robot.id
        self._limits = robot.limits
        self._flight = flight
        self._minutes = minutes
        self._path: NDArray[np.float64] = _flown(flight)[:, :2]
        """Positions in the air, shape (N, 2)."""

    def all(self, others: Iterable[OtherLease]) -> Iterator[Finding]:
        yield from self._landing()
        yield from self._fence()
        yield from self._waypoints()
        yield from self._battery()
        for other in others:
            yield from self._separation(other)

    def _landing(self) -> Iterator[Finding]:
        end, flight = _landing_time(self._flight), self._flight
        if end is None and flight.bands[-1].state == "aborted":
            yield Finding(f"{self._id} did not land as planned: {flight.outcome}", self._last())
        elif end is None:
            yield Finding(
                f"{self._id} had not landed after {flight.bands[-1].end:.0f} s "
                f"({flight.outcome}), and the lease is for {60 * self._minutes:.0f} s: have the "
                "mission end by itself, or ask for a longer lease",
                self._last(),
            )
        elif end > 60.0 * self._minutes:
            yield Finding(
                f"{self._id} landed after {end:.0f} s, and the lease is for "
                f"{60 * self._minutes:.0f} s: ask for a longer one, or fly a shorter way",
                self._at(60.0 * self._minutes),
            )

    def _fence(self) -> Iterator[Finding]:
        area = Geofence(self._limits.geofence).area
        if area is not None and len(self._path):
            outside = shapely.distance(area, shapely.points(self._path))
            worst = int(np.argmax(outside))
            if (metres := float(np.max(outside))) > 0.0:
                yield Finding(
                    f"{self._id} left the fence by {metres:.1f} m at "
                    f"{_place(self._path[worst])}: plan further inside it, or fly slower",
                    _pair(self._path[worst]),
                )
        for limit, what in _BOUNDARIES.items():
            count = self._flight.clipped[limit]
            if count:
                first = self._flight.clipped_at[limit]
                place = self._at(first)
                yield Finding(
                    f"{self._id}: {what} changed {count} setpoints, first after {first:.1f} s"
                    f"{f' at {_place(place)}' if place else ''}: plan further inside it, or lease "
                    "a larger area",
                    place,
                )

    def _waypoints(self) -> Iterator[Finding]:
        for name in self._flight.given_up:
            planned = self._flight.plan.get(name)
            where = None if planned is None else planned[:2]
            yield Finding(
                f"{self._id} gave up waypoint {name}"
                f"{f' at {_place(where)}' if where else ''}: move it within reach and inside the "
                "fence, or leave it out",
                where,
            )

    def _battery(self) -> Iterator[Finding]:
        charges = self._flight.battery[np.isfinite(self._flight.battery)]
        reserve = self._limits.battery_land
        if len(charges) and charges[-1] < reserve:
            yield Finding(
                f"{self._id} began with {charges[0]:.0%} of its battery and ended with "
                f"{charges[-1]:.0%}, below the reserve of {reserve:.0%}: fly a shorter way, or "
                "wait until it is charged",
                self._last(),
            )

    def _separation(self, other: OtherLease) -> Iterator[Finding]:
        if not len(self._path):
            return
        away = shapely.distance(shapely.Polygon(other.area), shapely.points(self._path))
        nearest, metres = int(np.argmin(away)), float(np.min(away))
        wanted = self._limits.separation
        if metres < wanted or metres <= 0.0:
            near = "into" if metres <= 0.0 else f"to {metres:.2f} m from"
            yield Finding(
                f"{self._id} flew {near} the area of lease {other.id} at "
                f"{_place(self._path[nearest])}, and {wanted:g} m are to be kept: stay away from "
                "it, or wait for the end of that lease",
                _pair(self._path[nearest]),
            )

    def _at(self, time: float) -> tuple[float, float] | None:
        times = self._flight.time
        if not len(times):
            return None
        index = min(int(np.searchsorted(times, time)), len(times) - 1)
        return _pair(self._flight.position[index])

    def _last(self) -> tuple[float, float] | None:
        return _pair(self._flight.position[-1]) if len(self._flight.states) else None


def _near_misses(nearest: Iterable[ClearanceOut]) -> Iterator[Finding]:
    for one in nearest:
        if one.distance >= CLEARANCE:
            continue
        what, place = f"{one.label} {one.thing}", _place(one.place)
        near = f"came to {one.distance:.2f} m from {what}"
        event = near if one.distance > 0.0 else f"hit {what}"
        yield Finding(
            f"{one.robot} {event} at {place}, {one.place[2]:.1f} m up, after {one.time:.1f} s, and "
            f"{CLEARANCE:g} m are to be kept: fly around it or higher",
            one.place[:2],
        )


def _alerts(alerts: Iterable[tuple[float, str, str]]) -> Iterator[Finding]:
    told = set()
    for at, kind, text in alerts:
        if kind in _FAILURES and (kind, text) not in told:
            told.add((kind, text))
            yield Finding(f"after {at:.1f} s, {kind.replace('_', ' ')}: {text}")


def _pair(position: NDArray[np.float64]) -> tuple[float, float]:
    return float(position[0]), float(position[1])


def _place(position: Sequence[float] | NDArray[np.float64]) -> str:
    return f"({position[0]:.1f}, {position[1]:.1f})"


def together(verdicts: Sequence[VerdictOut]) -> VerdictOut:
    """The verdict of several flights, each with another seed.

    It is approved if all of them are. A reason that some flights lack names the seeds of those that
    have it. Times, distances and charges are the greatest ones, the clearance is the smallest.

    Args:
        verdicts: Of the flights, one at least.
    """
    if len(verdicts) == 1:
        return verdicts[0]
    seeds: dict[str, list[int]] = {}
    for one in verdicts:
        for reason in one.reasons:
            seeds.setdefault(reason, []).extend(one.seeds)
    reasons = [
        reason if len(of) == len(verdicts) else f"seed {', '.join(map(str, of))}: {reason}"
        for reason, of in seeds.items()
    ]
    near = [one.clearance for one in verdicts if one.clearance is not None]
    # The way that is drawn is the one of the picture.
    shown = next((one for one in verdicts if not one.approved), verdicts[0])
    return shown.model_copy(
        update={
            "approved": all(one.approved for one in verdicts),
            "reasons": reasons,
            "seconds": _greatest(one.seconds for one in verdicts),
            "distance": _greatest(one.distance for one in verdicts),
            "battery_used": _greatest(one.battery_used for one in verdicts),
            "seeds": [seed for one in verdicts for seed in one.seeds],
            "clearance": min(near, key=lambda one: one.distance, default=None),
        }
    )


def _greatest(values: Iterable[float | None]) -> float | None:
    return max((value for value in values if value is not None), default=None)


def judge(
    recording: Path,
    config: EnvironmentConfig,
    *,
    minutes: float,
    others: Sequence[OtherLease] = (),
) -> VerdictOut:
    """The verdict of a rehearsed flight.

    Args:
        recording: MCAP file of the flight.
        config: Environment that it flew in.
        minutes: Of the lease.
        others: Areas of all other granted leases.

    Returns:
        Every reason against the flight, with its figures and a remedy; without any it is
        approved. The time is that of the last landing, distance and battery are sums over robots.

    Raises:
        RecordingError: If the recording cannot be read.
        ConfigError: If a robot's fence, the world or the terrain is invalid.
    """
    with Recording.open(recording) as opened:
        flight, whole = RecordedFlight.read(opened), opened.complete and not opened.damaged
    nearest = clearances(flight, config)
    findings = findings_of(flight, config, minutes=minutes, others=others, nearest=nearest)
    reasons = [one.text for one in findings]
    if not whole:
        reasons.append("the rehearsal's recording breaks off: submit the mission again")
    robots = [robot for robot in flight.robots.values() if robot.bands]
    landings = [end for robot in robots if (end := _landing_time(robot)) is not None]
    charges = [robot.battery[np.isfinite(robot.battery)] for robot in robots]
    return VerdictOut(
        approved=not reasons,
        reasons=reasons,
        seconds=max(landings, default=None),
        distance=sum(robot.distance for robot in robots),
        battery_used=float(sum(known[0] - known[-1] for known in charges if len(known))),
        seeds=[config.simulation.seed],
        clearance=min(nearest, key=lambda one: one.distance, default=None),
        tracks={name: _track(robot) for name, robot in flight.robots.items() if robot.bands},
    )
