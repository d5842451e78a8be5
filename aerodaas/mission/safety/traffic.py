"""Other aircraft and drones nearby: which come too near, what that demands, and who is silent."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from aerodaas.clock import seconds
from aerodaas.config.robot import LimitsConfig
from aerodaas.config.traffic import TrafficConfig
from aerodaas.geometry.frames import Vector, is_finite
from aerodaas.messages.records import fast_pickle
from aerodaas.messages.vehicle import Traffic, VehicleState
from aerodaas.mission.safety.failsafe import FailsafeAction, Fault

__all__ = [
    "DEMANDS",
    "SILENT",
    "Encounter",
    "Neighbour",
    "Neighbours",
    "TrafficWatch",
    "Whereabouts",
    "encounters",
    "meets_in",
    "traffic_neighbours",
]

SILENT = 1.0
"""Seconds after which a drone that tells nothing of its place is no longer believed to brake: it
tells twenty times a second."""


@dataclass(frozen=True, slots=True, eq=False)
class Neighbour:
    """Something else that flies: position (ENU metres) and velocity (ENU m/s)."""

    position: Vector
    """`up` is NaN for an aircraft whose height is not known."""
    velocity: Vector
    apart: tuple[float, float] | None = None
    """Metres along the ground and in height to keep from what does not give way: one of the two is
    enough. None: another drone of ours, which brakes, too."""
    limit: str = "separation"
    """The limit that a setpoint is said to be clipped by because of it."""


@fast_pickle
@dataclass(frozen=True, slots=True, eq=False)
class Whereabouts:
    """Where one of our drones was at `stamp` (mission clock, ns), by its own state."""

    stamp: int
    position: Vector
    """Metres, ENU."""
    velocity: Vector
    """m/s, ENU."""
    flying: bool

    @classmethod
    def of(cls, state: VehicleState) -> Whereabouts | None:
        """By its newest state; None where that has a number that is not finite."""
        place, velocity = state.odometry.position, state.odometry.velocity
        known = is_finite(place) and is_finite(velocity)
        return cls(state.stamp, place, velocity, state.armed) if known else None

    def age(self, now: int) -> float:
        """Seconds since then; 0 on the ground, where a drone stays without telling so."""
        return max(0.0, seconds(now - self.stamp)) if self.flying else 0.0


class Neighbours:
    """Where our drones are, by what each has told last."""

    def __init__(self) -> None:
        """Know of none."""
        self._known: dict[str, Whereabouts] = {}
        self._silent: set[str] = set()
        self._now = 0
        self._present: dict[str, tuple[Whereabouts, float, Neighbour]] = {}
        """What is known of each at `_now`, for which distance, and what that makes of it: all
        drones of one node ask at one moment."""

    def hear(self, name: str, where: Whereabouts | None) -> None:
        """Take what the drone `name` tells; None, a place unknown to it, leaves the last."""
        if where is not None:
            self._known[name] = where

    def of(self, names: Collection[str]) -> dict[str, Whereabouts]:
        """What is known of these drones."""
        return {name: self._known[name] for name in names if name in self._known}

    def around(self, name: str, now: int, separation: float) -> list[Neighbour]:
        """All but the drone `name`, which keeps `separation` metres, where they are by now.

        Each is where its velocity has taken it since it told. After `SILENT` seconds that is a
        guess: it is kept away from like an aircraft that flies on and does not give way.
        """
        if separation <= 0.0:
            return []
        if now != self._now:
            self._now = now
            self._present.clear()
        return [self._by_now(other, separation) for other in self._known if other != name]

    def _by_now(self, name: str, separation: float) -> Neighbour:
        where, made = self._known[name], self._present.get(name)
        if made is not None and made[0] is where and made[1] == separation:
            return made[2]
        age = where.age(self._now)
        position = where.position + where.velocity * min(age, SILENT)
        apart = (separation, separation) if age > SILENT else None
        neighbour = Neighbour(position, where.velocity, apart)
        self._present[name] = where, separation, neighbour
        return neighbour

    def newly_silent(self, now: int, own: Collection[str]) -> list[str]:
        """Drones other than our `own` that have told nothing for `SILENT` s; each silence once."""
        silent = {
            name
            for name, where in self._known.items()
            if name not in own and where.age(now) > SILENT
        }
        new, self._silent = silent - self._silent, silent
        return sorted(new)


DEMANDS = {
    "hold": FailsafeAction.HOLD,
    "return": FailsafeAction.RETURN,
    "land": FailsafeAction.LAND,
}
"""What an aircraft that is too near demands, by `TrafficConfig.action`."""
_CLEAR = 5.0
"""Seconds for which an aircraft counts as near after it was last, for reports come each second."""
_RELEASE = 1.2
"""Multiple of distance and height beyond which it is near no more, beside the drone's own way:
nothing is to start and stop at the edge."""
_STEP = 10.0
"""Metres to which distances are told: a text that changes with each reading tells nobody more."""


@dataclass(frozen=True, slots=True, eq=False)
class Encounter:
    """An aircraft that is too near, or will be soon."""

    aircraft: Traffic
    away: float
    """Metres along the ground."""
    above: float
    """Metres above the drone, NaN if that is not known."""
    after: float
    """Seconds until it is too near; 0: it is."""

    @property
    def text(self) -> str:
        """One sentence for the operator."""
        away = _STEP * round(self.away / _STEP)
        if not math.isfinite(self.above):
            height = "at an unknown height"
        else:
            metres = _STEP * round(abs(self.above) / _STEP)
            height = f"{metres:.0f} m {'above' if self.above >= 0.0 else 'below'}"
        soon = ", coming nearer" if self.after > 0.0 else ""
        return f"traffic: {self.aircraft.callsign} is {away:.0f} m away, {height}{soon}"


class TrafficWatch:
    """What the traffic around one drone demands, turn by turn."""

    def __init__(self, limits: LimitsConfig) -> None:
        """Judge for a drone of these `limits`."""
        self._config = config = limits.traffic
        # It would be near again at once if the drone flew on.
        further = {
            "distance": _RELEASE * config.distance + limits.cruise_speed * config.lookahead,
            "height": _RELEASE * config.height + limits.max_climb * config.lookahead,
        }
        self._further = config.model_copy(update=further)
        self._near: dict[int, tuple[int, Fault]] = {}
        """When each aircraft was last too near (mission clock, ns), and what was said of it."""

    def assess(self, state: VehicleState, now: int) -> list[Fault]:
        """A fault for each aircraft that is too near to `state`, or was until a moment ago."""
        demand = DEMANDS.get(self._config.action, FailsafeAction.NOTHING)
        known = [one for one in state.traffic if one.address in self._near]
        for one in (
            *encounters(state, state.traffic, self._config),
            *encounters(state, known, self._further),
        ):
            address = one.aircraft.address
            self._near[address] = now, Fault(demand, "traffic", one.text, f"{address:06X}")
        self._near = {
            address: (when, fault)
            for address, (when, fault) in self._near.items()
            if seconds(now - when) <= _CLEAR
        }
        return [fault for _, fault in self._near.values()]


def encounters(
    state: VehicleState, traffic: Sequence[Traffic], config: TrafficConfig
) -> list[Encounter]:
    """Those of `traffic` that are too near to the vehicle, or will be in the time looked ahead."""
    odometry = state.odometry
    known = is_finite(odometry.position) and is_finite(odometry.velocity)
    if config.action == "ignore" or not known:
        return []
    found = []
    for aircraft in traffic:
        way = aircraft.position - odometry.position
        after = meets_in(way, aircraft.velocity - odometry.velocity, config)
        if after is not None:
            found.append(Encounter(aircraft, math.hypot(way[0], way[1]), float(way[2]), after))
    return found


def meets_in(way: Vector, closing: Vector, config: TrafficConfig) -> float | None:
    """Seconds until an aircraft is within distance and height; 0 if it is, None if it will not be.

    It is `way` from the drone (ENU metres, `up` NaN where that is not known) and moves against it
    by `closing` (ENU m/s), both straight on. Exactly at distance and height is within.
    """
    level = _within(way[:2], closing[:2], config.distance)
    upright = (-math.inf, math.inf)
    if math.isfinite(way[2]):
        upright = _within(way[2:], closing[2:], config.height)
    begin = max(0.0, level[0], upright[0])
    end = min(config.lookahead, level[1], upright[1])
    return begin if begin <= end else None


def _within(way: Vector, closing: Vector, reach: float) -> tuple[float, float]:
    """From when until when a point that moves straight is within `reach`; seconds, maybe past.

    The end lies before the beginning if it never is.
    """
    never = (math.inf, -math.inf)
    square, half = float(closing @ closing), float(way @ closing)
    outside = float(way @ way) - reach * reach
    if square == 0.0:
        return never if outside > 0.0 else (-math.inf, math.inf)
    discriminant = half * half - square * outside
    if discriminant < 0.0:
        return never
    root = math.sqrt(discriminant)
    return (-half - root) / square, (-half + root) / square


def traffic_neighbours(state: VehicleState, config: TrafficConfig) -> list[Neighbour]:
    """The aircraft to keep away from, where the drone does more than tell of them."""
    if config.action not in DEMANDS:
        return []
    apart = config.distance, config.height
    return [Neighbour(one.position, one.velocity, apart, "traffic") for one in state.traffic]
