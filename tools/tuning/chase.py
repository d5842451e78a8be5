"""One flight after a walking person: the simulated drone, its mission and the follower's loop.

All of the system but its actors: the vehicle with wind and noise, the setpoint loop at 20 Hz with
its clamps, the follower with the latency from capture to command. The same seed gives the same
flight.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.base import ComputeKind
from aerodaas.analytics.follow.analytics import FollowAnalytics
from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SimulationConfig
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.mission.commands import OpenStream, Start, StreamItem
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler
from aerodaas.simulation.world import Thing
from tools.tuning.perception import Perception, box_in_picture

__all__ = ["TELLO", "Chase", "ChaseResult"]

TELLO = CameraModel.from_fov(640, 360, math.radians(82.6), mount=(0.1, 0.0, 0.08))
"""The default simulated camera: the Tello's field of view."""

_TICK = 10_000_000
_TURN = 50_000_000
_STREAM = "drone/follow"


@dataclass
class ChaseResult:
    """What was flown, one entry for each frame; metres, seconds."""

    time: NDArray[np.float64]
    distance: NDArray[np.float64]
    """Along the ground from the drone to the person."""
    height: NDArray[np.float64]
    in_view: NDArray[np.bool_]
    """Whether the middle of the target's true box was in the picture."""
    place: NDArray[np.float64]
    """The drone's, east and north."""
    person: NDArray[np.float64]
    alerts: list[str]

    def after(self, time: float) -> ChaseResult:
        """What was flown from `time` seconds on."""
        kept = self.time >= time
        return ChaseResult(
            self.time[kept],
            self.distance[kept],
            self.height[kept],
            self.in_view[kept],
            self.place[kept],
            self.person[kept],
            self.alerts,
        )

    def within(self, wanted: float, tolerance: float) -> float:
        """Share of the time in which the distance was `wanted` ± `tolerance` metres."""
        return float((np.abs(self.distance - wanted) <= tolerance).mean())

    def at_height(self, wanted: float, tolerance: float) -> float:
        """Share of the time in which the height was `wanted` ± `tolerance` metres."""
        return float((np.abs(self.height - wanted) <= tolerance).mean())


@dataclass
class _Moment:
    """The follower's context."""

    stamp: int = 0
    state: VehicleState | None = None
    alerts: list[Alert] = field(default_factory=list)
    kind: ComputeKind = "edge"

    def now(self) -> int:
        return self.stamp

    def vehicle(self) -> VehicleState | None:
        return self.state

    def alert(self, alert: Alert) -> None:
        self.alerts.append(alert)


@dataclass(frozen=True)
class Chase:
    """A follower's flight after `person`."""

    person: Thing
    label: str = "vest"
    rate: float = 10.0
    """Frames a second."""
    latency: float = 0.15
    """Seconds from capture to the arrival of the command made from it."""
    camera: CameraModel = TELLO
    wind: tuple[float, float, float] = (0.5, 0.3, 0.0)
    gust: float = 0.3
    seed: int = 0

    def fly(
        self,
        follow: FollowAnalytics,
        eyes: Perception,
        duration: float,
        watch: Callable[[Detections, Odometry], None] = lambda *_: None,
        monitor: Callable[[float, Odometry], None] = lambda *_: None,
    ) -> ChaseResult:
        """Take off and follow until `duration` seconds.

        `watch` gets what each frame showed; `monitor` the true pose at each turn of the setpoint
        loop, 20 times a second, as a meeting lasts less than a frame.
        """
        vehicle, loop = self._prepare(follow.controller.height)
        moment = _Moment()
        frames = max(1, round(NANOSECONDS / self.rate / _TICK)) * _TICK
        delay = round(self.latency * NANOSECONDS)
        waiting: deque[Detections] = deque()
        rows: list[tuple[float, ...]] = []
        for now in range(0, round(duration * NANOSECONDS), _TICK):
            vehicle.advance_to(now)
            if waiting and now - waiting[0].header.stamp >= delay:
                seen = waiting.popleft()
                moment.stamp, moment.state = now, vehicle.read()
                result = follow.examine(seen, moment)
                loop.mission.handle(StreamItem(_STREAM, result, seen.header), now)
            if now % _TURN == 0:
                loop.step(now)
                if loop.state is not None:
                    monitor(seconds(now), loop.state.truth or loop.state.odometry)
            if now % frames == 0:
                state = vehicle.read()
                pose = state.truth or state.odometry
                header = Header(len(rows), now, "drone/camera")
                waiting.append(eyes.look(header, pose, state.odometry, moment))
                rows.append(self._row(now, pose))
                watch(waiting[-1], pose)
        table = np.array(rows)
        return ChaseResult(
            table[:, 0],
            table[:, 1],
            table[:, 2],
            table[:, 3] > 0,
            table[:, 4:6],
            table[:, 6:8],
            [alert.kind for alert in moment.alerts],
        )

    def _prepare(self, height: float) -> tuple[SimulatedVehicle, SetpointLoop]:
        robot = RobotConfig.model_validate(
            {
                "id": "drone",
                "limits": {"takeoff_height": height, "max_speed": 3.0, "cruise_speed": 1.0},
            }
        )
        simulation = SimulationConfig(world="empty", seed=self.seed, wind=self.wind, gust=self.gust)
        environment = EnvironmentConfig(robots=[robot], simulation=simulation)
        vehicle = SimulatedVehicle(robot, environment)
        vehicle.connect()
        mission = Mission(
            robot, InlinePlanner(OrderedScheduler()), takeoff=vehicle.read().odometry.position
        )
        mission.handle(OpenStream(_STREAM), 0)
        mission.handle(Start(), 0)
        return vehicle, SetpointLoop(vehicle, mission)

    def _row(self, now: int, pose: Odometry) -> tuple[float, ...]:
        time = seconds(now)
        state = self.person.state(time)
        east, north = pose.position[:2].tolist()
        edges = box_in_picture(self.person, self.label, time, self.camera, pose)
        in_view = False
        if edges is not None:
            u, v = (edges[0] + edges[2]) / 2, (edges[1] + edges[3]) / 2
            in_view = 0 <= u <= self.camera.width and 0 <= v <= self.camera.height
        distance = math.hypot(state.x - east, state.y - north)
        return (time, distance, pose.height, in_view, east, north, state.x, state.y)
