"""A mission flown by a driver on a given clock, and what must hold whatever its vehicle says."""

from __future__ import annotations

import math
import queue
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from aerodaas.config.model import LimitsConfig, RobotConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.geometry.frames import Vector
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import PositionSetpoint, Setpoint, Vehicle, VehicleState
from aerodaas.messages.waypoints import VelocityCommand, Waypoint, WaypointType
from aerodaas.mission.commands import AddNavigation, Start, Steer, TakeControls
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler
from tools.fuzz.records import LONGEST_REST

__all__ = [
    "LIMITS",
    "START",
    "TURN",
    "FuzzedFlight",
    "ViolationError",
    "clock_of",
    "queues_of",
    "replaced",
    "require",
]

TURN = 0.05
"""Seconds of a turn of the setpoint loop."""
LIMITS = {
    "takeoff_height": 1.0,
    "max_speed": 2.0,
    "cruise_speed": 1.0,
    "max_climb": 1.0,
    "max_range": 12.0,
    "geofence": {"polygon": [[-8, -8], [8, -8], [8, 8], [-8, 8]], "floor": 0.3, "ceiling": 6.0},
}
"""Of the fuzzed robot."""
START = (7.99, 7.99, 0.0)
"""Where it stands: in a corner of its fence, which a wrong setpoint leaves at once."""
_HASTE = VelocityCommand(forward=9.0, left=5.0, up=3.0, yaw_rate=9.0)
"""Asked by hand: faster than allowed, and out of the fence."""
_SLACK = 1e-3
_NANOSECONDS = 1_000_000_000
_POLE = 90.0
"""Degrees of latitude."""


class ViolationError(Exception):
    """What must hold does not."""


def require(holds: object, what: str) -> None:
    """Raise ViolationError about `what` unless it `holds`."""
    if not holds:
        raise ViolationError(what)


class FuzzedFlight:
    """A mission on a connected vehicle, turned 20 times a second of a clock of its own."""

    by_hand = False
    """Whether somebody flies by hand, who wants to leave the fence as fast as possible: waypoints
    beyond it are refused before they are flown to."""

    def __init__(self, vehicle: Vehicle, robot: RobotConfig) -> None:
        """Plan a few waypoints."""
        self._vehicle = vehicle
        self._limits: LimitsConfig = robot.limits
        self.mission = Mission(
            robot, InlinePlanner(OrderedScheduler()), takeoff=vehicle.read().odometry.position
        )
        self._loop = SetpointLoop(vehicle, self.mission)
        places = ((6.0, 0.0, 2.0), (6.0, 6.0, 4.0), (0.0, 6.0, 2.0))
        waypoints = [
            Waypoint(f"w{index}", *place, waypoint_type=WaypointType.LOCAL)
            for index, place in enumerate(places)
        ]
        self.mission.handle(AddNavigation(AeroNavigation(data=waypoints)), 0)
        self.mission.handle(Start(), 0)
        self._now = 0

    @property
    def state(self) -> MissionState:
        """State of the mission."""
        return self.mission.state

    def fly(
        self,
        turn: Callable[[], None],
        hear: Callable[[int, bytes], None],
        heard: Iterable[tuple[int, int, bytes]],
        *,
        climb: int,
        by_hand: bool,
    ) -> None:
        """Take off in at most `climb` turns, then hear records, each with its turns after it."""
        for _ in range(climb):
            turn()
            if self.state is MissionState.ENROUTE:
                break
        self.by_hand = by_hand
        for kind, rest, body in heard:
            hear(kind, body)
            for _ in range(1 + rest % LONGEST_REST):
                turn()

    def turn(self) -> None:
        """Turn once, and check what was sent and what is believed."""
        self._now += round(TURN * _NANOSECONDS)
        if self.by_hand:
            self.mission.handle(TakeControls("somebody", 1), self._now)
            self.mission.handle(Steer(1, _HASTE), self._now)
        record = self._loop.step(self._now)
        state = self._loop.state
        if state is not None:
            _check_state(state)
        if record.sent is not None:
            self._check_setpoint(record.sent, None if state is None else state.odometry.position)
        printable = all(text.isprintable() for text in self.mission.status.faults)
        require(printable, "a fault that cannot be printed")

    def check_motion(self, velocity: Vector, yaw_rate: float) -> None:
        """Check a motion that leaves the host: ENU m/s and rad/s."""
        require(np.isfinite(velocity).all(), "a velocity that is no number")
        require(math.isfinite(yaw_rate), "a yaw rate that is no number")
        across, up = float(np.linalg.norm(velocity[:2])), abs(float(velocity[2]))
        require(across <= self._limits.max_speed + _SLACK, "faster than max_speed")
        require(up <= self._limits.max_climb + _SLACK, "faster than max_climb")

    def check_place(self, place: Vector, vehicle: Vector) -> None:
        """Check a place that leaves the host: within the fence, or where the vehicle is."""
        require(np.isfinite(place).all(), "a place that is no number")
        near = float(np.linalg.norm(place - vehicle)) <= 1.0 + 2.0 * self._limits.max_speed
        fence = self.mission.fence
        within = fence.inside(place) and fence.floor - 1.0 <= place[2] <= fence.ceiling + _SLACK
        require(near or within, "a place beyond the fence")

    def _check_setpoint(self, sent: Setpoint, position: Vector | None) -> None:
        if not isinstance(sent, PositionSetpoint):
            self.check_motion(sent.velocity, sent.yaw_rate)
            if position is not None and np.isfinite(position).all():
                self._check_way(position, position + TURN * sent.velocity)
            return
        require(np.isfinite(sent.position).all(), "a place that is no number")
        require(self.mission.fence.inside(sent.position), "a place beyond the fence")
        away = float(np.linalg.norm(sent.position - self.mission.home))
        require(away <= self._limits.max_range + _SLACK, "a place beyond the range")
        speed = math.hypot(self._limits.max_speed, self._limits.max_climb)
        require(sent.speed is None or 0.0 < sent.speed <= speed + _SLACK, "faster than allowed")

    def _check_way(self, position: Vector, after: Vector) -> None:
        fence = self.mission.fence
        if fence.inside(position):
            require(fence.inside(after), "a way out of the fence")
        else:
            out = (position - fence.nearest_allowed(position))[:2]
            onwards = float((after - position)[:2] @ out)
            require(onwards <= _SLACK * float(np.linalg.norm(out)), "away from the fence")
        top = max(fence.ceiling, float(position[2])) + _SLACK
        require(float(after[2]) <= top, "a way above the ceiling")


def _check_state(state: VehicleState) -> None:
    """Check that what the vehicle said is plausible or unknown, never nonsense."""
    charge, gps, odometry = state.battery.fraction, state.gps, state.odometry
    require(math.isnan(charge) or 0.0 <= charge <= 1.0, "a charge beyond 0 to 1")
    require(state.stamp >= 0, "a stamp before the mission")
    angles = (odometry.yaw, odometry.roll, odometry.pitch, odometry.yaw_rate)
    latitude, longitude = (0.0, 0.0) if gps is None else (gps.latitude, gps.longitude)
    require(abs(latitude) <= _POLE, "a latitude beyond the poles")
    require(abs(longitude) <= 2 * _POLE, "a longitude beyond 180 degrees")
    require(all(map(math.isfinite, angles)), "an attitude that is no number")
    require(np.isfinite(odometry.velocity).all(), "a velocity that is no number")


@contextmanager
def replaced(*places: tuple[ModuleType | type, str, Any]) -> Iterator[None]:
    """Context manager: each name of a module or class stands for another object."""
    before = [(owner, name, getattr(owner, name)) for owner, name, _ in places]
    for owner, name, new in places:
        setattr(owner, name, new)
    try:
        yield
    finally:
        for owner, name, old in before:
            setattr(owner, name, old)


def clock_of(rig: Any, sleep: Any) -> SimpleNamespace:  # noqa: ANN401 - anything with `now`
    """Stand-in for the module `time`, whose clock is the attribute `now` of `rig`."""
    return SimpleNamespace(monotonic=lambda: rig.now, sleep=sleep, time=lambda: 1.7e9 + rig.now)


def queues_of(rig: Any) -> SimpleNamespace:  # noqa: ANN401 - anything with `now` and `advance`
    """Stand-in for the module `queue`, whose readers let the time of `rig` pass while they wait."""
    return SimpleNamespace(SimpleQueue=lambda: _Queue(rig), Empty=queue.Empty)


class _Queue:
    """A queue that is filled while its reader waits."""

    def __init__(self, rig: Any) -> None:  # noqa: ANN401
        self._rig = rig
        self._items: list[Any] = []
        self.put: Callable[[Any], None] = self._items.append

    def get(self, timeout: float) -> Any:  # noqa: ANN401
        """The next item, within `timeout` seconds of the clock."""
        end = self._rig.now + timeout
        while not self._items:
            if self._rig.now >= end:
                raise queue.Empty
            self._rig.advance()
        return self._items.pop(0)
