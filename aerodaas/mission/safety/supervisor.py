"""Failsafe decisions from the drone's condition, independent of the application."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from aerodaas.config.model import LimitsConfig
from aerodaas.mission.log import subject
from aerodaas.mission.safety.failsafe import FailsafeAction, Fault
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.mission.safety.traffic import TrafficWatch
from aerodaas.types.clock import seconds
from aerodaas.types.energy import EnergyMeter
from aerodaas.types.geometry import Vector, is_finite
from aerodaas.types.vehicle import VehicleMode, VehicleState

__all__ = [
    "CALM",
    "Assessment",
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
    def demand(self) -> FailsafeAction:
        """The failsafe action demanded now."""
        return self.gravest.demand

    def news(self, before: Assessment) -> list[Fault]:
        """The faults that are to be told: those that there were not `before`.

        The reason for a takeover or a lost position already names the faults behind it.
        """
        known = {subject(one.kind, one.text, one.about) for one in before.findings}
        acts, reason = self.demand is not FailsafeAction.NOTHING, self.gravest.text
        return [
            one
            for one in self.findings
            if subject(one.kind, one.text, one.about) not in known
            and not (acts and one.kind == "vehicle" and one.text in reason)
        ]


_GUARDED = frozenset({VehicleMode.GUIDED, VehicleMode.MISSION})
"""Modes in which the drone flies where we want it."""
_SLACK = 0.5
"""Metres below the clearance from which people are told: a position's noise and lag are less."""

CALM = Assessment(Fault(FailsafeAction.NOTHING, "", ""))
"""An assessment without faults."""


class Supervisor:
    """Watches battery, link, position, mode and traffic of one vehicle in flight."""

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
        self._traffic = TrafficWatch(limits)
        self._lost_since: int | None = None
        self._blind_for = 0
        """Nanoseconds with a link since the vehicle last had a position."""
        self._assessed_at: int | None = None

    def assess(self, state: VehicleState, now: int) -> Assessment:
        """Assess `state`, read at `now` (mission clock, nanoseconds)."""
        checks = (
            self._mode(state),
            self._link(state, now),
            self._position(state, now),
            self._battery(state),
            self._place(state),
            self._ground(state),
        )
        self._assessed_at = now
        findings = [finding for finding in checks if finding is not None]
        findings += self._traffic.assess(state, now)
        findings += [Fault(FailsafeAction.NOTHING, "vehicle", text) for text in state.faults]
        if not findings:
            return CALM
        return Assessment(max(findings, key=lambda finding: finding.demand), tuple(findings))

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

    def _link(self, state: VehicleState, now: int) -> Fault | None:
        if not self._is_lost(state, now):
            self._lost_since = None
            return None
        if self._lost_since is None:
            self._lost_since = now
        duration = seconds(now - self._lost_since)
        what = "no word from the vehicle"
        if duration < self._limits.link_timeout:
            return Fault(FailsafeAction.HOLD, "link_lost", what)
        return Fault(FailsafeAction.RETURN, "link_lost", f"{what} for {duration:.0f} s")

    def _position(self, state: VehicleState, now: int) -> Fault | None:
        """Judge by the time in touch alone: a silent vehicle may know its position."""
        if self._is_lost(state, now):
            return None
        if has_position(state):
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

    def _battery(self, state: VehicleState) -> Fault | None:
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
        if not has_position(state):
            return None
        position = state.odometry.position
        needed = self._meter.way_home(position, self._home, limits.cruise_speed)
        if charge <= needed + limits.battery_land:
            text = f"the way home needs {needed:.0%} of the battery's {charge:.0%}"
            return Fault(FailsafeAction.RETURN, "battery_low", text)
        return None

    def _place(self, state: VehicleState) -> Fault | None:
        position = state.odometry.position
        if has_position(state) and not self._fence.inside(position):
            text = f"the drone is outside its geofence, at {_place(position)}"
            return Fault(FailsafeAction.NOTHING, "geofence", text)
        return None

    def _ground(self, state: VehicleState) -> Fault | None:
        """Tell of a drone that is nearer to the ground on its way than it may be."""
        if self._clearance is None or state.mode not in _GUARDED:
            return None
        if not has_position(state):
            return None
        position = state.odometry.position
        slack = np.array([0.0, 0.0, _SLACK])
        objection = self._clearance.objection(position + slack)
        return Fault(FailsafeAction.NOTHING, "ground", objection) if objection else None


def charge_objection(state: VehicleState, limits: LimitsConfig) -> str:
    """Why the battery's charge allows no take-off; empty if it does, or is not known."""
    charge = state.battery.fraction
    if not math.isfinite(charge) or charge > limits.battery_return:
        return ""
    return (
        f"the battery is at {charge:.0%}, and the drone returns at "
        f"{limits.battery_return:.0%}: charge it"
    )


def place_objections(state: VehicleState, limits: LimitsConfig, fence: Geofence) -> list[str]:
    """Why nothing may take off where the drone stands; empty if it may."""
    if not has_position(state):
        return ["the vehicle does not know its position"]
    reasons, position = list[str](), state.odometry.position
    if not fence.inside(position):
        reasons.append(f"the drone stands outside its geofence, at {_place(position)}")
    height = float(position[2]) + limits.takeoff_height
    if not fence.floor <= height <= fence.ceiling:
        reasons.append(
            f"taking off to {height:g} m leaves the geofence's heights of "
            f"{fence.floor:g} to {fence.ceiling:g} m"
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
