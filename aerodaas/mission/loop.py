"""The setpoint loop: read the vehicle, update the mission, clamp, send, and record the setpoint."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.errors import VehicleError
from aerodaas.geometry.frames import is_close
from aerodaas.messages.frames import Header
from aerodaas.messages.health import HealthItem, HealthReport
from aerodaas.messages.mission import MissionState, SetpointRecord
from aerodaas.messages.vehicle import (
    PositionSetpoint,
    Setpoint,
    Vehicle,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)
from aerodaas.mission.mission import Mission
from aerodaas.mission.motion_requests import (
    Fly,
    Hold,
    Land,
    MotionRequest,
    Return,
    Supervise,
    TakeOff,
    Wait,
)
from aerodaas.mission.safety.checklist import Checklist, concerns, refusals
from aerodaas.mission.safety.neighbours import Neighbour
from aerodaas.mission.safety.setpoint_filter import SetpointFilter

__all__ = ["SetpointLoop"]

_REPEAT = NANOSECONDS
"""Nanoseconds after which a request without effect is sent again."""

_EXAMINED_ANEW = NANOSECONDS
"""Nanoseconds between two looks at the health of a drone whose mission has not been started."""

_PERIOD = 0.05
"""Seconds assumed between turns, for the first one."""

_DOING = {
    TakeOff: frozenset({VehicleMode.TAKING_OFF, VehicleMode.GUIDED, VehicleMode.HOLDING}),
    Land: frozenset({VehicleMode.LANDING, VehicleMode.GROUNDED}),
    Return: frozenset({VehicleMode.RETURNING, VehicleMode.LANDING, VehicleMode.GROUNDED}),
}
"""Vehicle modes in which a request is already being carried out."""


class SetpointLoop:
    """The setpoint loop of one drone, turned by its node 20 times a second."""

    def __init__(self, vehicle: Vehicle, mission: Mission) -> None:
        """Fly `vehicle` by `mission`, within the mission's limits."""
        self.vehicle = vehicle
        self.mission = mission
        self._checklist = Checklist(vehicle, mission.limits, mission.preflight)
        self.guard = SetpointFilter(
            mission.limits,
            mission.home,
            position_setpoints=vehicle.capabilities.position_setpoints,
            clearance=mission.clearance,
        )
        self.state: VehicleState | None = None
        """The newest vehicle state read."""
        self._items: tuple[HealthItem, ...] = ()
        self._examined_at: int | None = None
        """When the list before take-off was examined last."""
        self._before: int | None = None
        self._last_request: type[MotionRequest] | None = None
        self._asked_at = 0

    def step(self, now: int, neighbours: Iterable[Neighbour] = ()) -> SetpointRecord:
        """Execute one cycle of the loop.

        Args:
            now: Mission clock, nanoseconds.
            neighbours: The other drones to keep away from.

        Returns:
            The setpoints requested and sent.

        Raises:
            VehicleError: If the vehicle has never given a state.
        """
        state = self._read()
        items = self._examined(state, now)
        request = self.mission.update(state, now, refusals(items))
        if isinstance(request, TakeOff):
            for text in concerns(items):
                self.mission.concern(text)
        try:
            record = self._carry_out(request, state, now, neighbours)
        except VehicleError as error:
            self.mission.vehicle_refused(str(error))
            record = SetpointRecord(now, None, None)
        finally:
            self._last_request = type(request)
            self._before = now
        self.mission.command_sent(request, record.sent)
        return record

    @property
    def health(self) -> HealthReport:
        """The list before take-off as it was examined last, with its age at the newest turn."""
        if self._examined_at is None or self._before is None:
            return HealthReport()
        return HealthReport(self._items, seconds(max(0, self._before - self._examined_at)))

    def _examined(self, state: VehicleState, now: int) -> tuple[HealthItem, ...]:
        """The list as it counts for this turn: in preflight alone, and examined anew then."""
        before, at = self.mission.state, self._examined_at
        known = at is not None and now - at < _EXAMINED_ANEW
        if before is MissionState.PREFLIGHT or (before is MissionState.IDLE and not known):
            self._items, self._examined_at = tuple(self._checklist.examine(state)), now
            return self._items if before is MissionState.PREFLIGHT else ()
        return ()

    def _read(self) -> VehicleState:
        try:
            self.state = self.vehicle.read()
        except VehicleError:
            if self.state is None:
                raise
            self.state = replace(self.state, mode=VehicleMode.LOST)
        return self.state

    def _carry_out(
        self,
        request: MotionRequest,
        state: VehicleState,
        now: int,
        neighbours: Iterable[Neighbour],
    ) -> SetpointRecord:
        if isinstance(request, Fly):
            return self._send(request.setpoint, state, now, neighbours, request.cause)
        if isinstance(request, Hold):
            stay: Setpoint = VelocitySetpoint(np.zeros(3))
            if request.position is not None and self.vehicle.capabilities.position_setpoints:
                stay = PositionSetpoint(request.position)
            return self._send(stay, state, now, neighbours)
        self.guard.forget()
        if isinstance(request, Supervise):
            return self._supervise(state, now, neighbours)
        if not isinstance(request, Wait):
            self._ask(request, state, now)
        return SetpointRecord(now, None, None)

    def _supervise(
        self, state: VehicleState, now: int, neighbours: Iterable[Neighbour]
    ) -> SetpointRecord:
        """Watch the autopilot fly, and stop it at once where it comes too near to a boundary."""
        others = self._around(state, neighbours)
        names = self.guard.crossed(state.odometry, others, below=state.below)
        if not names:
            return SetpointRecord(now, None, None)
        self.mission.take_back(f"it came too near to a boundary ({', '.join(names)})")
        return self._send(VelocitySetpoint(np.zeros(3)), state, now, neighbours)

    def _around(self, state: VehicleState, neighbours: Iterable[Neighbour]) -> list[Neighbour]:
        return [*neighbours, *self.mission.neighbours(state)]

    def _ask(self, request: TakeOff | Land | Return, state: VehicleState, now: int) -> None:
        """Send the request once, then every second while the vehicle's mode does not show it."""
        new = self._last_request is not type(request)
        overdue = state.mode not in _DOING[type(request)] and now - self._asked_at >= _REPEAT
        if not (new or overdue):
            return
        self._asked_at = now
        if isinstance(request, TakeOff):
            self.vehicle.take_off(request.height)
        elif isinstance(request, Return):
            self.vehicle.return_home()
        else:
            self.vehicle.land()

    def _send(
        self,
        asked: Setpoint,
        state: VehicleState,
        now: int,
        neighbours: Iterable[Neighbour],
        cause: Header | None = None,
    ) -> SetpointRecord:
        duration = _PERIOD if self._before is None else seconds(now - self._before)
        others = self._around(state, neighbours)
        below = state.below
        clamped = self.guard.clamp(asked, state.odometry, duration, others, below=below)
        sent = self.vehicle.send(clamped.setpoint)
        names = clamped.clipped_by
        if sent is not clamped.setpoint and not _same(sent, clamped.setpoint):
            names = (*names, "vehicle")
        return SetpointRecord(now, asked, sent, names, cause)


def _same(one: Setpoint, other: Setpoint) -> bool:
    if isinstance(one, VelocitySetpoint) and isinstance(other, VelocitySetpoint):
        return is_close(one.velocity, other.velocity) and one.yaw_rate == other.yaw_rate
    if isinstance(one, PositionSetpoint) and isinstance(other, PositionSetpoint):
        return is_close(one.position, other.position) and one.speed == other.speed
    return False
