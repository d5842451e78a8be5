"""Failsafe decisions from the drone's condition, independent of the application."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.config.extensions import added
from aerodaas.config.model import LimitsConfig
from aerodaas.geometry.energy import EnergyMeter
from aerodaas.geometry.frames import Vector, is_finite, length
from aerodaas.messages.vehicle import COLLISION, VehicleMode, VehicleState
from aerodaas.mission.log import subject
from aerodaas.mission.safety.failsafe import FailsafeAction, Fault
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.mission.safety.motion import STANDS_AFTER, MotionWatch
from aerodaas.mission.safety.neighbours import Neighbour

__all__ = [
    "CALM",
    "Assessment",
    "SafetyRule",
    "Supervisor",
    "charge_objection",
    "has_position",
    "place_objections",
]


@dataclass(frozen=True, slots=True)
class Assessment:
    """All current faults, and the gravest of them."""

    gravest: Fault
    findings: tuple[Fault, ...] = ()

    @property
    def action(self) -> FailsafeAction:
        """The failsafe action demanded now."""
        return self.gravest.demand

    def new_findings(self, before: Assessment) -> list[Fault]:
        """The faults that are to be told: those that there were not `before`.

        A takeover is told as soon as it is settled why (`Supervisor.taken_over`).
        The reason for a takeover or a lost position already names the faults behind it.
        """
        known = {subject(one.kind, one.text, one.about) for one in before.findings}
        acts, reason = self.action is not FailsafeAction.NOTHING, self.gravest.text
        return [
            one
            for one in self.findings
            if subject(one.kind, one.text, one.about) not in known
            and one.demand is not FailsafeAction.RELEASE
            and not (acts and one.kind == "vehicle" and one.text in reason)
        ]


_GUARDED = frozenset({VehicleMode.GUIDED, VehicleMode.MISSION})
"""Modes in which the drone flies where we want it."""
_SLACK = 0.5
"""Metres below the clearance from which people are told: a position's noise and lag are less."""
_SETTLED = 2 * NANOSECONDS
"""Nanoseconds after a takeover in which the reason for it may become known."""
_BEYOND = 2.0
"""Metres above the ceiling, or out of range, from which the drone is outside: a place on the very
limit is allowed, and flown with noise and lag."""
_LOW = 1.0
"""Metres above the ground, as far as its height is known, up to which a drone may stand on it."""

CALM = Assessment(Fault(FailsafeAction.NOTHING, "", ""))
"""An assessment without faults."""


class SafetyRule(Protocol):
    """Rule of an extension for one drone in flight (`Extension.safety_rules`)."""

    def assess(self, state: VehicleState, now: int) -> list[Fault]:
        """Faults at present, and what they demand; the gravest of all rules decides.

        Args:
            state: The vehicle's state.
            now: Mission clock at which it was read, nanoseconds.
        """
        ...

    def neighbours(self, state: VehicleState) -> list[Neighbour]:
        """Other aircraft around the vehicle, to be kept away from."""
        ...


class Supervisor:
    """Watches battery, link, position and mode of one vehicle in flight, and extensions' rules."""

    _STALE = 1.0
    """Age in seconds from which a vehicle's state no longer shows its position."""

    def __init__(
        self,
        limits: LimitsConfig,
        home: Vector,
        fence: Geofence,
        meter: EnergyMeter,
        clearance: GroundClearance | None = None,
    ) -> None:
        """Watch a vehicle that took off at `home` (ENU metres)."""
        self._clearance = clearance
        self._limits = limits
        self._home = home
        self._fence = fence
        self._meter = meter
        self._rules: list[SafetyRule] = [rule(limits) for rule in added("safety_rules")]
        self.motion = MotionWatch(limits)
        """Told by the setpoint loop what the drone follows."""
        self._taken: Fault | None = None
        self._taken_at = 0
        self._outside_since: int | None = None
        self._lost_since: int | None = None
        self._blind_for = 0
        """Nanoseconds with a link since the vehicle last had a position."""
        self._assessed_at: int | None = None

    def assess(self, state: VehicleState, now: int) -> Assessment:
        """Assess `state`.

        Args:
            state: The vehicle's state.
            now: Mission clock at which it was read, nanoseconds.
        """
        lost, located = self._is_lost(state, now), has_position(state)
        checks = (
            self._mode(state),
            self._link(now, lost=lost),
            self._position(state, now, lost=lost, located=located),
            self._battery(state, located=located),
            self._place(state, now, located=located),
            self._ground(state, located=located),
            *self._motion(state, now, known=located and not lost),
        )
        self._assessed_at = now
        findings = [finding for finding in checks if finding is not None]
        if (pilot := checks[0]) is not None:
            self._taken_at = now if self._taken is None else self._taken_at
            self._taken = pilot
        for rule in self._rules:
            findings += rule.assess(state, now)
        findings += [Fault(FailsafeAction.NOTHING, _kind(text), text) for text in state.faults]
        if not findings:
            return CALM
        return Assessment(max(findings, key=lambda finding: finding.demand), tuple(findings))

    def neighbours(self, state: VehicleState) -> list[Neighbour]:
        """Other aircraft around the vehicle, by the rules of extensions."""
        return [one for rule in self._rules for one in rule.neighbours(state)]

    def taken_over(self, now: int) -> tuple[Fault, bool] | None:
        """Fault of a lasting takeover, as last assessed; None without one.

        The second value tells whether the reason is settled at `now` (mission clock, nanoseconds).
        """
        if self._taken is None:
            return None
        return self._taken, now - self._taken_at >= _SETTLED

    def silent_for(self, now: int) -> float:
        """Seconds since the link was lost, as last assessed; 0 while it is up."""
        return 0.0 if self._lost_since is None else seconds(now - self._lost_since)

    def lost_for_good(self, now: int) -> str:
        """Why the vehicle counts as lost after `return_timeout` of silence; empty if it does not.

        `now` is the mission clock, nanoseconds.
        """
        silent = self.silent_for(now)
        lost = silent >= self._limits.return_timeout
        return f"the vehicle is lost: no word from it for {silent:.0f} s" if lost else ""

    def objections(self, state: VehicleState) -> list[str]:
        """Reasons against taking off now that waiting will not remove."""
        reasons: list[str] = []
        if state.mode is not VehicleMode.GROUNDED:
            reasons.append(f"the vehicle is {state.mode.value}, not on the ground")
        if objection := charge_objection(state, self._limits):
            reasons.append(objection)
        return reasons + place_objections(state, self._limits, self._fence)

    def _mode(self, state: VehicleState) -> Fault | None:
        if state.mode is VehicleMode.MANUAL:
            return Fault(FailsafeAction.RELEASE, "pilot", "a pilot has taken over")
        if state.mode is VehicleMode.FAILSAFE:
            why = f": {'; '.join(state.faults)}" if state.faults else ""
            text = f"the vehicle's own protection has taken over{why}"
            return Fault(FailsafeAction.RELEASE, "failsafe", text)
        return None

    def _link(self, now: int, *, lost: bool) -> Fault | None:
        if not lost:
            self._lost_since = None
            return None
        if self._lost_since is None:
            self._lost_since = now
        duration = seconds(now - self._lost_since)
        what = "no word from the vehicle"
        if duration < self._limits.link_timeout:
            return Fault(FailsafeAction.HOLD, "link_lost", what)
        return Fault(FailsafeAction.RETURN, "link_lost", f"{what} for {duration:.0f} s")

    def _position(
        self, state: VehicleState, now: int, *, lost: bool, located: bool
    ) -> Fault | None:
        """Judge by the time in touch alone: a silent vehicle may know its position."""
        if lost:
            return None
        if located:
            self._blind_for = 0
            return None
        if self._assessed_at is not None and self._lost_since is None:
            self._blind_for += now - self._assessed_at
        what = "; ".join(["the vehicle does not know its position", *state.faults])
        duration = seconds(self._blind_for)
        if duration < self._limits.link_timeout:
            return Fault(FailsafeAction.HOLD, "no_position", what)
        return Fault(FailsafeAction.LAND, "no_position", f"{what}, for {duration:.0f} s")

    def _is_lost(self, state: VehicleState, now: int) -> bool:
        return state.mode is VehicleMode.LOST or seconds(now - state.stamp) > self._STALE

    def _battery(self, state: VehicleState, *, located: bool) -> Fault | None:
        limits, charge = self._limits, state.battery.fraction
        if not math.isfinite(charge):
            return Fault(
                FailsafeAction.NOTHING, "battery_unknown", "the battery's charge is not known"
            )
        if charge <= limits.battery_land:
            text = f"the battery is critical at {charge:.0%}"
            return Fault(FailsafeAction.LAND, "battery_critical", text)
        if charge <= limits.battery_return:
            return Fault(
                FailsafeAction.RETURN, "battery_low", f"the battery is low at {charge:.0%}"
            )
        if not located:
            return None
        position = state.odometry.position
        needed = self._meter.way_home(position, self._home, limits.cruise_speed)
        if charge <= needed + limits.battery_land:
            text = f"the way home needs {needed:.0%} of the battery's {charge:.0%}"
            return Fault(FailsafeAction.RETURN, "battery_low", text)
        return None

    def _place(self, state: VehicleState, now: int, *, located: bool) -> Fault | None:
        """Judge where the drone is: outside its fence the guard brings it back while it holds."""
        where = self._outside(state.odometry.position) if located else ""
        if not where:
            self._outside_since = None
            return None
        if self._outside_since is None:
            self._outside_since = now
        patient = seconds(now - self._outside_since) < self._limits.link_timeout
        demand = FailsafeAction.HOLD if patient else FailsafeAction.RETURN
        return Fault(demand, "geofence", where, "" if patient else "return")

    def _outside(self, position: Vector) -> str:
        if not self._fence.inside(position):
            return f"the drone is outside its geofence, at {_place(position)}"
        if position[2] > self._fence.ceiling + _BEYOND:
            return f"the drone is above its geofence's ceiling, at {_place(position)}"
        if length(position - self._home) > self._limits.max_range + _BEYOND:
            return f"the drone is out of its range (limits.max_range), at {_place(position)}"
        return ""

    def _motion(self, state: VehicleState, now: int, *, known: bool) -> list[Fault]:
        """Judge whether the drone moves as commanded.

        One that is carried off goes home; where it is carried off on the way, too, or while it
        takes off, it lands.
        """
        if not known:
            self.motion.forget()
            return []
        self.motion.observe(state, now)
        faults = []
        if self.motion.carried_off:
            text = (
                f"the drone is carried off at {self.motion.drift:.1f} m/s against its commands, "
                "as by wind that it cannot hold"
            )
            home = self.motion.carried_off == 1 and state.mode is not VehicleMode.TAKING_OFF
            demand = FailsafeAction.RETURN if home else FailsafeAction.LAND
            faults.append(Fault(demand, "wind", text, "" if home else "land"))
        if self.motion.stands_for < STANDS_AFTER:
            return faults
        what = f"for {STANDS_AFTER:g} s, and its motors run"
        rest = "if it stands on the ground, stop them by remote control"
        if state.mode is VehicleMode.LANDING:
            text = f"the landing drone has come no lower {what}: {rest}"
            faults.append(Fault(FailsafeAction.NOTHING, "motors_running", text))
        elif self._height(state) < _LOW:
            text = f"the drone has neither climbed nor moved as commanded {what}: it lands; {rest}"
            faults.append(Fault(FailsafeAction.LAND, "motors_running", text, "land"))
        return faults

    def _height(self, state: VehicleState) -> float:
        """Metres above the ground; where that is not known, above the place of take-off."""
        if state.below is not None:
            return state.below
        east, north, up = (float(axis) for axis in state.odometry.position)
        ground = math.nan if self._clearance is None else self._clearance.ground.height(east, north)
        return up - (float(self._home[2]) if math.isnan(ground) else ground)

    def _ground(self, state: VehicleState, *, located: bool) -> Fault | None:
        """Tell of a drone that is nearer to the ground on its way than it may be."""
        if self._clearance is None or state.mode not in _GUARDED or not located:
            return None
        position = state.odometry.position
        slack = np.array([0.0, 0.0, _SLACK])
        objection = self._clearance.objection(position + slack)
        return Fault(FailsafeAction.NOTHING, "ground", objection) if objection else None


def _kind(fault: str) -> str:
    return COLLISION if fault.startswith(COLLISION) else "vehicle"


def charge_objection(state: VehicleState, limits: LimitsConfig) -> str:
    """Why the battery's charge allows no take-off; empty if it does, or is not known.

    Args:
        state: The vehicle's state, of which the battery counts.
        limits: `battery_return` is the charge that take-off needs more than, 0 to 1.
    """
    charge = state.battery.fraction
    if not math.isfinite(charge) or charge > limits.battery_return:
        return ""
    return (
        f"the battery is at {charge:.0%}, and the drone returns at "
        f"{limits.battery_return:.0%} (limits.battery_return): charge it"
    )


def place_objections(state: VehicleState, limits: LimitsConfig, fence: Geofence) -> list[str]:
    """Why nothing may take off where the drone stands; empty if it may.

    Args:
        state: The vehicle's state, of which the position counts.
        limits: `takeoff_height` is to lie within the fence's heights.
        fence: The drone's geofence.
    """
    if not has_position(state):
        return ["the vehicle does not know its position"]
    reasons, position = list[str](), state.odometry.position
    if not fence.inside(position):
        where = _place(position)
        reasons.append(f"the drone stands outside its geofence (limits.geofence), at {where}")
    height = float(position[2]) + limits.takeoff_height
    if not fence.floor <= height <= fence.ceiling:
        reasons.append(
            f"taking off to {height:g} m leaves the geofence's heights of "
            f"{fence.floor:g} to {fence.ceiling:g} m (limits.takeoff_height, limits.geofence)"
        )
    return reasons


def has_position(state: VehicleState) -> bool:
    """Return whether the vehicle's position, velocity and yaw are known."""
    odometry = state.odometry
    return (
        is_finite(odometry.position)
        and is_finite(odometry.velocity)
        and math.isfinite(odometry.yaw)
    )


def _place(position: Vector) -> str:
    return f"({position[0]:.1f}, {position[1]:.1f}, {position[2]:.1f}) m"
