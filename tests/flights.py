"""A kinematic vehicle and a loop that flies missions with it, for tests."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import LimitsConfig, MissionConfig, RobotConfig
from aerodaas.config.sections.actuators import ActuatorConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.geometry.frames import GeodeticOrigin, Vector, wrap_angle
from aerodaas.messages.mission import MissionState, MissionStatus, SetpointRecord
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import (
    Capabilities,
    PositionSetpoint,
    Setpoint,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)
from aerodaas.messages.waypoints import NavigationType, SchedulingType, Waypoint
from aerodaas.mission.commands import AddNavigation, Answer, Command, OpenStream, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner, Planner
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.schedulers.trajectory.base import TrajectoryScheduler
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

PERIOD = NANOSECONDS // 20


class KinematicVehicle:
    """A point whose velocity follows its setpoint by a first-order response."""

    LAG = 0.2
    """Time constant in seconds."""

    def __init__(
        self,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        *,
        drain: float = 0.0,
        charge: float = 1.0,
        position_setpoints: bool = True,
        wind: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Stand at `start`; the battery loses `drain` of its charge each second in the air."""
        self.capabilities = Capabilities("kinematic", position_setpoints=position_setpoints)
        self.position = np.array(start, dtype=np.float64)
        self.velocity = np.zeros(3)
        self.yaw = 0.0
        self.wind = np.array(wind)
        self.charge = charge
        self.drain = drain
        self.mode = VehicleMode.GROUNDED
        self.objections: list[str] = []
        self.faults: tuple[str, ...] = ()
        self.calls: list[str] = []
        self.sent: list[Setpoint] = []
        self.lost = False
        self.blind = False
        self._ground = float(start[2])
        self._home = self.position.copy()
        self._height = 0.0
        self._setpoint: Setpoint | None = None
        self._now = 0

    def connect(self, timeout: float = 10.0) -> None:
        """Be connected."""

    def read(self) -> VehicleState:
        """Return the state."""
        position = np.full(3, np.nan) if self.blind else self.position.copy()
        flies = self.mode is not VehicleMode.GROUNDED
        odometry = Odometry(position, self.velocity + self.wind * flies, self.yaw)
        state = VehicleState(
            self._now,
            odometry,
            Battery(self.charge),
            self.mode,
            self.mode is not VehicleMode.GROUNDED,
            faults=self.faults,
        )
        return replace(state, mode=VehicleMode.LOST) if self.lost else state

    def preflight(self) -> list[str]:
        """Return the objections set by the test."""
        return self.objections

    def take_off(self, height: float) -> None:
        """Climb at 1 m/s."""
        self.calls.append("take_off")
        self.mode = VehicleMode.TAKING_OFF
        self._height = self._ground + height

    def send(self, setpoint: Setpoint) -> Setpoint:
        """Follow a setpoint."""
        assert self.mode not in {VehicleMode.MANUAL, VehicleMode.FAILSAFE}, "a pilot flies"
        self.sent.append(setpoint)
        self.mode = VehicleMode.GUIDED
        self._setpoint = setpoint
        return setpoint

    def hold(self) -> None:
        """Stand still."""
        self.calls.append("hold")
        self._setpoint = None

    def return_home(self) -> None:
        """Fly home and land."""
        self.calls.append("return_home")
        self.mode = VehicleMode.RETURNING

    def land(self) -> None:
        """Descend at 1 m/s."""
        self.calls.append("land")
        self.mode = VehicleMode.LANDING

    def close(self) -> None:
        """Let go."""

    def advance_to(self, stamp: int) -> None:
        """Simulate in steps of 10 ms."""
        step = NANOSECONDS // 100
        while self._now < stamp:
            self._now += step
            self._step(0.01)

    def kill(self) -> None:
        """Stop the motors wherever it is."""
        self.mode = VehicleMode.GROUNDED

    def _fall(self, duration: float) -> None:
        if self.position[2] <= self._ground:
            self.velocity[:] = 0.0
            self.position[2] = self._ground
            return
        self.velocity[2] -= 9.81 * duration
        self.position += self.velocity * duration

    def _step(self, duration: float) -> None:
        if self.mode is VehicleMode.GROUNDED:
            self._fall(duration)
            return
        wanted, turn = self._wanted()
        self.velocity += (wanted - self.velocity) * (duration / self.LAG)
        self.position += (self.velocity + self.wind) * duration
        self.yaw = wrap_angle(self.yaw + turn * duration)
        self.charge = max(0.0, self.charge - self.drain * duration)
        if self.mode is VehicleMode.TAKING_OFF and self.position[2] >= self._height - 0.05:
            self.mode = VehicleMode.HOLDING
        if self.position[2] <= self._ground:
            self.position[2] = self._ground
            self.velocity[2] = max(0.0, self.velocity[2])
            if self.mode is VehicleMode.LANDING:
                self.mode = VehicleMode.GROUNDED

    def _wanted(self) -> tuple[Vector, float]:
        if self.mode is VehicleMode.TAKING_OFF:
            return np.array([0.0, 0.0, 1.0]), 0.0
        if self.mode is VehicleMode.LANDING:
            return np.array([0.0, 0.0, -1.0]), 0.0
        if self.mode is VehicleMode.RETURNING:
            way = self._home - self.position
            way[2] = 0.0
            if np.linalg.norm(way) < 0.2:
                self.mode = VehicleMode.LANDING
            return self._towards(way, 2.0), 0.0
        if isinstance(self._setpoint, VelocitySetpoint):
            return self._setpoint.velocity, self._setpoint.yaw_rate
        if isinstance(self._setpoint, PositionSetpoint):
            asked = self._setpoint
            turn = 0.0 if asked.yaw is None else 2.0 * wrap_angle(asked.yaw - self.yaw)
            return self._towards(asked.position - self.position, asked.speed or 1.0), turn
        return np.zeros(3), 0.0

    @staticmethod
    def _towards(way: Vector, speed: float) -> Vector:
        distance = float(np.linalg.norm(way))
        return way * (min(speed, distance) / distance) if distance > 0.0 else np.zeros(3)


@dataclass
class Flight:
    """A mission on its way, and everything that was seen of it."""

    vehicle: KinematicVehicle
    mission: Mission
    loop: SetpointLoop
    now: int = 0
    states: list[MissionState] = field(default_factory=list)
    track: list[Vector] = field(default_factory=list)
    records: list[SetpointRecord] = field(default_factory=list)

    def turn(self) -> SetpointRecord:
        """One period of the loop."""
        record = self.loop.step(self.now)
        if not self.states or self.states[-1] is not self.mission.state:
            self.states.append(self.mission.state)
        self.records.append(record)
        self.track.append(self.vehicle.position.copy())
        self.now += PERIOD
        self.vehicle.advance_to(self.now)
        return record

    def tell(self, command: Command) -> Answer:
        """Hand a command to the mission."""
        return self.mission.handle(command, self.now)

    def run(self, duration: float = 600.0, until: Callable[[], bool] | None = None) -> None:
        """Fly until the mission is over, `until` holds, or `duration` seconds have passed."""
        end = self.now + round(duration * NANOSECONDS)
        while self.now < end and not self.mission.finished and not (until and until()):
            self.turn()

    def run_to(self, state: MissionState) -> None:
        """Fly until the mission is in `state`."""
        self.run(until=lambda: self.mission.state is state)
        self.expect(state)

    def keep_saying(self, command: Callable[[], Command], duration: float, rate: float) -> None:
        """Repeat a command at `rate` Hz while flying for `duration` seconds."""
        pause = max(1, round(20 / rate))
        for number in range(round(duration * 20)):
            if number % pause == 0:
                self.tell(command())
            self.turn()

    def expect(self, state: MissionState) -> None:
        """Fail unless the mission is in `state`."""
        assert self.mission.state is state, f"{self.status.state}: {self.status.reason}"

    @property
    def status(self) -> MissionStatus:
        """What the mission says."""
        return self.mission.status

    @property
    def seconds(self) -> float:
        """Mission time."""
        return self.now / NANOSECONDS


def flight(
    *commands: Command,
    scheduler: TrajectoryScheduler | None = None,
    limits: LimitsConfig | None = None,
    options: MissionConfig | None = None,
    vehicle: KinematicVehicle | None = None,
    planner: Planner | None = None,
    origin: GeodeticOrigin | None = None,
    start: bool = True,
    clearance: GroundClearance | None = None,
    sea_level: float | None = None,
    actuators: Sequence[ActuatorConfig] = (),
) -> Flight:
    """Prepare a flight that has been told `commands` and then to start."""
    vehicle = vehicle or KinematicVehicle()
    robot = RobotConfig(
        id="drone",
        limits=limits or LimitsConfig(),
        mission=options or MissionConfig(),
        actuators=list(actuators),
    )
    planner = planner or InlinePlanner(scheduler or OrderedScheduler())
    takeoff = vehicle.position.copy()
    mission = Mission(
        robot,
        planner,
        takeoff=takeoff,
        origin=origin,
        clearance=clearance,
        sea_level=sea_level,
        vehicle=vehicle,
    )
    prepared = Flight(vehicle, mission, SetpointLoop(vehicle, mission))
    for command in (*commands, *([Start()] if start else [])):
        prepared.tell(command)
    return prepared


def add(
    *waypoints: Waypoint, ordered: bool = True, index: int | None = None, clear_first: bool = False
) -> AddNavigation:
    """Add waypoints."""
    return AddNavigation(navigation(waypoints, ordered=ordered), index, clear_first=clear_first)


def navigation(items: Iterable[Waypoint], *, ordered: bool = True) -> AeroNavigation:
    """Make navigation of waypoints."""
    scheduling = SchedulingType.ORDERED if ordered else SchedulingType.UNORDERED
    return AeroNavigation(NavigationType.DISTANCE_DRIVEN, items, scheduling)


def live(name: str = "drone/follow", *, clear_first: bool = False) -> OpenStream:
    """Open a stream of navigation."""
    return OpenStream(name, clear_first=clear_first)


def square(side: float = 10.0, height: float = 1.5, hover: float = 0.0) -> list[Waypoint]:
    """Four corners, the first one at home."""
    corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
    return [
        Waypoint(f"wp{number}", x, y, height, hover)
        for number, (x, y) in enumerate(corners, start=1)
    ]


def length(track: list[Vector]) -> float:
    """Metres flown."""
    return math.fsum(float(np.linalg.norm(b - a)) for a, b in pairwise(track))


def passed_at(one: Flight, waypoint_id: str) -> float:
    """Speed at which a waypoint itself is passed, where it was highest on the way there."""
    speeds = [0.0]
    while (current := one.status.target) is None or current.id != waypoint_id:
        one.turn()
    while (current := one.status.target) is not None and current.id == waypoint_id:
        sent = one.turn().sent
        if isinstance(sent, PositionSetpoint) and np.array_equal(sent.position, current.position):
            speeds.append(sent.passing_speed)
    return max(speeds)


class Waiting(Executor):
    """Runs what it is given when asked to."""

    def __init__(self) -> None:
        self.jobs: list[tuple[Future[Any], Any]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:  # noqa: ANN401
        """Keep the job."""
        future: Future[Any] = Future()
        self.jobs.append((future, lambda: fn(*args, **kwargs)))
        return future

    def finish(self) -> None:
        """Run what waits."""
        jobs, self.jobs = self.jobs, []
        for future, job in jobs:
            future.set_result(job())
