"""Other aircraft around a drone: which come too near, and what that demands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from aerodaas.clock import seconds
from aerodaas.config.checked import added_settings
from aerodaas.config.model import LimitsConfig, PreflightConfig
from aerodaas.extensions.traffic.settings import TrafficConfig, TrafficLimits
from aerodaas.geometry.frames import Vector, is_finite
from aerodaas.messages.health import HealthItem, HealthReadings, Verdict
from aerodaas.messages.vehicle import Traffic, VehicleState
from aerodaas.mission.safety.checklist import PreflightCheck
from aerodaas.mission.safety.failsafe import FailsafeAction, Fault
from aerodaas.mission.safety.neighbours import Neighbour

__all__ = ["Encounter", "TrafficWatch", "encounters", "meets_in", "preflight_check"]

_DEMANDS = {
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
    """Safety rule of one drone: demands of the traffic around it, cycle by cycle."""

    def __init__(self, limits: LimitsConfig) -> None:
        """Judge for a drone of these `limits`."""
        self._config = config = added_settings(limits, TrafficLimits).traffic
        # It would be near again at once if the drone flew on.
        further = {
            "distance": _RELEASE * config.distance + limits.cruise_speed * config.lookahead,
            "height": _RELEASE * config.height + limits.max_climb * config.lookahead,
        }
        self._further = config.model_copy(update=further)
        self._near: dict[int, tuple[int, Fault]] = {}
        """When each aircraft was last too near (mission clock, ns), and what was said of it."""

    def assess(self, state: VehicleState, now: int) -> list[Fault]:
        """A fault for each aircraft that is too near to `state`, or was until a moment ago.

        Args:
            state: The vehicle's state with the traffic that it sees.
            now: Mission clock, nanoseconds.
        """
        demand = _DEMANDS.get(self._config.action, FailsafeAction.NOTHING)
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

    def neighbours(self, state: VehicleState) -> list[Neighbour]:
        """The aircraft to keep away from, where the drone does more than tell of them."""
        if self._config.action not in _DEMANDS:
            return []
        apart = self._config.distance, self._config.height
        return [Neighbour(one.position, one.velocity, apart, "traffic") for one in state.traffic]


def preflight_check(limits: LimitsConfig, policy: PreflightConfig) -> PreflightCheck:
    """The item of the list before take-off, where the vehicle hears of any aircraft.

    Args:
        limits: The robot's limits, `traffic` among them.
        policy: Levels of other items; none of them counts.
    """
    del policy
    config = added_settings(limits, TrafficLimits).traffic

    def examine(state: VehicleState, _: HealthReadings) -> HealthItem | None:
        if config.action == "ignore" or not state.traffic:
            return None
        near = encounters(state, state.traffic, config)
        value = "; ".join(one.text.removeprefix("traffic: ") for one in near)
        bound = f"none within {config.distance:g} m and {config.height:g} m of height"
        verdict = Verdict.REFUSED if config.action in _DEMANDS else Verdict.WARNING
        return HealthItem("traffic", value or "none near", bound, verdict if near else Verdict.GOOD)

    return PreflightCheck("traffic", "wait until it is gone", examine)


def encounters(
    state: VehicleState, traffic: Sequence[Traffic], config: TrafficConfig
) -> list[Encounter]:
    """Aircraft that are too near to the vehicle, or will be within the time looked ahead.

    Args:
        state: The vehicle's state; none without a finite position and velocity.
        traffic: The aircraft to compare with.
        config: Distance, height and time looked ahead; none for the action `ignore`.
    """
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

    Both fly straight on. Exactly at distance and height is within.

    Args:
        way: From the drone to the aircraft, ENU metres; `up` is NaN where it is not known.
        closing: Velocity of the aircraft against the drone, ENU m/s.
        config: Distance and height in metres, and seconds looked ahead.
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
