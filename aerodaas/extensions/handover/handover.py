"""Hand-over of a mission's waypoints to the autopilot's own mission mode, and their take-back.

The drone flies on by setpoints until the vehicle shows its mission mode. From then on it sends
none, follows what the vehicle says of its progress, and believes it where the drone was there.
Whatever else is to be done, by a command, a failsafe or the guard, takes the waypoints back first,
and the first setpoint, or order to return or land, ends the vehicle's mission mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import seconds
from aerodaas.config.sections.robot import LimitsConfig
from aerodaas.errors import VehicleError
from aerodaas.extensions.handover.mission_mode import (
    MissionMode,
    MissionModePhase,
    PlannedPlace,
)
from aerodaas.geometry.frames import Vector
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import Vehicle, VehicleMode, VehicleState, equipment_of
from aerodaas.mission.commands import Answer, HandOver, TakeBack
from aerodaas.mission.handover import HANDED_OVER, Handover, HandoverContext
from aerodaas.mission.navigation.queue import QueuedWaypoint
from aerodaas.mission.navigation.route import Route
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.mission.safety.supervisor import has_position

__all__ = ["AutopilotHandover", "planned_places", "unflyable"]

_NAMED = 3
"""Most reasons that are named."""


def planned_places(
    stops: Sequence[QueuedWaypoint], limits: LimitsConfig, fastest: float
) -> list[PlannedPlace]:
    """The places of `stops`, as an autopilot is told them.

    Args:
        stops: The stops, in the order flown.
        limits: Of the drone; its cruise speed is for stops without a speed.
        fastest: The most that the vehicle can do, m/s.
    """
    most = min(limits.max_speed, fastest)
    return [
        PlannedPlace(
            stop.waypoint.position,
            min(stop.waypoint.speed or limits.cruise_speed, most),
            max(0.0, stop.remaining_hover),
            stop.waypoint.yaw,
        )
        for stop in stops
    ]


def unflyable(
    stops: Sequence[QueuedWaypoint],
    position: Vector,
    limits: LimitsConfig,
    route: Route,
    clearance: GroundClearance | None,
) -> str:
    """Why an autopilot cannot fly by `stops`; empty if it can.

    Args:
        stops: The stops, in the order flown.
        position: Where the flight to the first of them begins, ENU metres.
        limits: Of the drone.
        route: Ways around no-fly zones and the geofence.
        clearance: The height to keep above the ground; None without a terrain.
    """
    reasons = []
    if limits.rangefinder_clearance > 0.0:
        reasons.append("rangefinder_clearance is kept by setpoints alone")
    for stop in stops:
        purposes = dict.fromkeys(action.purpose for action in stop.waypoint.actions)
        reasons += [f"{stop.id}: it {purpose}" for purpose in purposes]
    places = [position, *(stop.waypoint.position for stop in stops)]
    for stop, (start, end) in zip(stops, pairwise(places), strict=True):
        text = ""
        if stop.above_ground is not None:
            text = "the way there follows the ground"
        elif route.towards(end, start) is not end:
            text = "the way there leads around a no-fly zone or a corner of the geofence"
        elif clearance is not None:
            text = _too_low(start, end, clearance)
        reasons += [f"{stop.id}: {text}"] if text else []
    more = f"; and {len(reasons) - _NAMED} more" if len(reasons) > _NAMED else ""
    return "; ".join(reasons[:_NAMED]) + more


def _too_low(start: Vector, end: Vector, clearance: GroundClearance) -> str:
    distances, heights = clearance.ground.along(start, end)
    long = float(distances[-1])
    shares = distances / long if long > 0.0 else np.zeros_like(distances)
    above = start[2] + shares * (end[2] - start[2]) - heights
    # NaN, where the ground is not known, is too low.
    if bool(np.all(above >= clearance.clearance)):
        return ""
    return f"the way there comes nearer to the ground than {clearance.clearance:g} m"


_STEERED = frozenset({VehicleMode.GUIDED, VehicleMode.HOLDING})
"""Modes of a vehicle that follows setpoints, or is about to."""
_KIND = "handover"
"""Kind of the alerts."""
_ROUNDING = 5.0
"""Metres beyond the arrival radius within which an autopilot may round a waypoint off."""
_PROGRESS = 0.1
"""Metres of approach that count as progress: more than the position's noise."""
_UPLOADS = 3
"""How often the rest of a plan is uploaded, where waypoints are reached meanwhile."""


class AutopilotHandover(Handover):
    """Handover of one mission's waypoints to the autopilot."""

    def __init__(self, context: HandoverContext) -> None:
        """Use the mission mode of the vehicle, if it has one."""
        super().__init__(context)
        self._mode = equipment_of(context.vehicle, MissionMode)
        self._flies = False
        self._stops: list[QueuedWaypoint] = []
        """What was uploaded; empty while nothing is handed over."""
        self._places: NDArray[np.float64] = np.empty((0, 3))
        self._nearest: NDArray[np.float64] = np.empty(0)
        """Metres from each of them at which the drone was since the autopilot flies."""
        self._hovers = False
        """Whether it stays at a waypoint."""
        self._done = 0
        self._uploads = 0
        self._nearer_at = 0
        """Mission clock at which it last came nearer to the next one, nanoseconds."""
        self._approach = np.inf

    @property
    def active(self) -> bool:
        """Whether waypoints are handed over, or about to be."""
        return bool(self._stops)

    @property
    def flies(self) -> bool:
        """Whether the autopilot flies."""
        return self._flies

    def handle(
        self,
        command: HandOver | TakeBack,
        mission: MissionState,
        stops: Sequence[QueuedWaypoint],
        state: VehicleState | None,
        now: int,
        ongoing: str = "",
    ) -> Answer:
        """Begin to upload the stops, or take them back."""
        if isinstance(command, TakeBack):
            if not self.active:
                return Answer(accepted=False, text="the autopilot flies none of its waypoints")
            self.take_back("asked to", now)
            return Answer(accepted=True)
        if self.active:
            return Answer(accepted=False, text="its waypoints are handed over already")
        if mission not in HANDED_OVER or not stops or state is None:
            text = f"waypoints are handed over in flight to one, and the drone is {mission.value}"
            return Answer(accepted=False, text=text)
        self._uploads = 0
        text = ongoing or self._upload(list(stops), state)
        return Answer(not text, text and f"the autopilot cannot fly this: {text}")

    def situation(self, stop: QueuedWaypoint) -> tuple[MissionState, str]:
        """The state of a mission whose next `stop` the autopilot serves, and its reason."""
        if self._hovers:
            return MissionState.LOITERING, f"at {stop.id}, by the autopilot's mission mode"
        return MissionState.ENROUTE, f"flying to {stop.id} by the autopilot's mission mode"

    def _upload(self, stops: list[QueuedWaypoint], state: VehicleState) -> str:
        """Begin to upload `stops`; returns why not, empty if it is under way."""
        mode, vehicle, limits = self._mode, self.context.vehicle, self.context.robot.limits
        if mode is None or not isinstance(vehicle, Vehicle):
            return f"its driver, {self.context.robot.driver}, knows no mission mode"
        if state.mode not in _STEERED or not has_position(state):
            return f"the vehicle is {state.mode.value}"
        position = state.odometry.position
        if text := unflyable(stops, position, limits, self.context.route, self.context.clearance):
            return text
        places = planned_places(stops, limits, vehicle.capabilities.max_speed)
        if text := mode.objection(places):
            return text
        try:
            mode.upload(places)
        except VehicleError as error:
            return str(error)
        self._stops, self._done = stops, 0
        self._uploads += 1
        self._places = np.array([place.position for place in places])
        self._nearest = np.full(len(stops), np.inf)
        return ""

    def take_back(self, reason: str, now: int) -> None:
        """Let the drone fly by setpoints again, if the autopilot flies or is about to."""
        if not self._stops:
            return
        if self._mode is not None:
            self._mode.clear()
        what = "the hand-over has ended" if self._flies else "not handed over"
        self.context.log.alert(now, _KIND, f"{what}: {reason}")
        self._stops = []
        self._flies = self._hovers = False

    def step(self, stops: Sequence[QueuedWaypoint], state: VehicleState, now: int) -> bool:
        """Follow how far the hand-over is; a plan that has changed on the way is taken back."""
        mode = self._mode
        if not self._stops or mode is None:
            return False
        ahead, queued = self._stops[self._done :], list(stops)
        progress = mode.progress
        if progress.phase is MissionModePhase.FAILED:
            self.take_back(progress.fault, now)
        elif queued == ahead:
            self._advance(mode, progress.phase, state, now)
        elif self._flies or queued != ahead[-len(queued) :] or self._uploads == _UPLOADS:
            self.take_back("what is to be flown has changed", now)
        elif text := self._upload(queued, state):
            self.take_back(text, now)
        return self._flies

    def _advance(
        self, mode: MissionMode, phase: MissionModePhase, state: VehicleState, now: int
    ) -> None:
        if phase is MissionModePhase.READY and state.mode is VehicleMode.GUIDED:
            try:
                mode.start()
            except VehicleError as error:
                self.take_back(str(error), now)
        elif phase is MissionModePhase.FLYING and not self._flies:
            self._flies, self._nearer_at, self._approach = True, now, np.inf
            count = len(self._stops)
            some = f"{count} waypoint{'s' if count > 1 else ''}"
            self.context.log.alert(now, _KIND, f"handed over to the autopilot: {some}")
        elif self._flies and (
            phase is not MissionModePhase.FLYING
            or state.mode not in {VehicleMode.MISSION, VehicleMode.LOST}
        ):
            self.take_back("it has left its mission mode", now)

    def follow(self, state: VehicleState, now: int, elapsed: float) -> list[QueuedWaypoint]:
        """The stops that were reached since the last turn, in order.

        Takes back what is not flown as it should be.
        """
        mode = self._mode
        if mode is None or not self._flies or not has_position(state):
            return []
        progress, radius = mode.progress, self.context.robot.limits.arrival_radius
        distances = np.linalg.norm(self._places - state.odometry.position, axis=1)
        self._nearest = np.minimum(self._nearest, distances)
        reached: list[QueuedWaypoint] = []
        while self._done < min(progress.done, len(self._stops)):
            stop, nearest = self._stops[self._done], float(self._nearest[self._done])
            if nearest > radius + _ROUNDING:
                text = (
                    f"it says that it was at {stop.id}, and was never nearer than {nearest:.0f} m"
                )
                self.take_back(text, now)
                return reached
            reached.append(stop)
            self._done += 1
            self._nearer_at, self._approach = now, np.inf
        if progress.fault:
            self.take_back(progress.fault, now)
        elif self._done == len(self._stops):
            self.take_back("all waypoints are flown", now)
        else:
            self._watch(float(distances[self._done]), radius, now, elapsed)
        return reached

    def _watch(self, distance: float, radius: float, now: int, elapsed: float) -> None:
        """Count the stay at the next stop, and miss what does not come nearer to it."""
        stop, patience = self._stops[self._done], self.context.robot.mission.stall_timeout
        self._hovers = distance <= radius and stop.remaining_hover > 0.0
        if self._hovers:
            stop.remaining_hover -= elapsed
        if self._hovers or distance < self._approach - _PROGRESS:
            self._nearer_at, self._approach = now, min(distance, self._approach)
        elif seconds(now - self._nearer_at) > patience:
            self.take_back(f"it has come no nearer to {stop.id} for {patience:g} s", now)
