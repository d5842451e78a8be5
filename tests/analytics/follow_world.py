"""A tiny kinematic world for following: a point drone, a pinhole camera, a walking target."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from aerodaas.analytics.base import ComputeKind
from aerodaas.analytics.follow.analytics import FollowAnalytics
from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import CameraModel, Vector, body_to_enu, enu_to_body
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.messages.waypoints import VelocityCommand

TELLO = CameraModel.from_fov(1280, 720, math.radians(82.6), mount=(0.1, 0.0, 0.0))
Path = Callable[[float], tuple[float, float]]
"""East and north of the target at a time in seconds."""


def frame(step: int, *items: Detection, odometry: Odometry | None = None) -> Detections:
    """Frame `step` of 10 a second."""
    header = Header(step, step * NANOSECONDS // 10, "drone/cam")
    return Detections(header, items, 1280, 720, TELLO, odometry)


@dataclass
class Snapshot:
    """What an analysis may ask of its actor."""

    stamp: int
    odometry: Odometry | None
    alerts: list[Alert]
    kind: ComputeKind = "edge"

    def now(self) -> int:
        """Stamp of the item."""
        return self.stamp

    def vehicle(self) -> VehicleState | None:
        """The newest state."""
        if self.odometry is None:
            return None
        return VehicleState(self.stamp, self.odometry, Battery(1.0), VehicleMode.GUIDED, armed=True)

    def alert(self, alert: Alert) -> None:
        """Keep the alert."""
        self.alerts.append(alert)


@dataclass
class World:
    """The drone reaches a commanded velocity with a lag, and frames reach it late."""

    target: Path
    position: Vector
    yaw: float = 0.0
    target_height: float = 1.7
    target_width: float = 0.5
    target_base: float = 0.0
    label: str = "person"
    rate: float = 10.0
    noise: float = 0.0
    """Standard deviation of a box's edges, in parts of its height."""
    odometry: bool = True
    camera: CameraModel = TELLO
    hidden: Callable[[float], bool] = lambda _: False
    velocity: Vector = field(default_factory=lambda: np.zeros(3))
    yaw_rate: float = 0.0
    time: float = 0.0
    alerts: list[Alert] = field(default_factory=list)
    commands: list[VelocityCommand | None] = field(default_factory=list)

    def run(self, follow: FollowAnalytics, duration: float, seed: int = 0) -> list[float]:
        """Fly for `duration` seconds; return the distance along the ground at each frame."""
        random = np.random.default_rng(seed)
        distances: list[float] = []
        waiting: list[Detections] = [self.look(random)]
        for _ in range(round(duration * self.rate)):
            waiting.append(self.look(random))
            # The frame before this one has just been analysed.
            result = follow.process(waiting.pop(0), self.snapshot())
            command = result.commands[0] if result is not None else None
            self.commands.append(command)
            self.fly(command or VelocityCommand())
            distances.append(self.distance)
        return distances

    @property
    def distance(self) -> float:
        """Metres along the ground from the drone to the target."""
        return float(np.hypot(*(np.array(self.target(self.time)) - self.position[:2])))

    def state(self) -> Odometry:
        """The drone's true odometry."""
        velocity = body_to_enu(self.velocity, self.yaw)
        return Odometry(self.position.copy(), velocity, self.yaw, yaw_rate=self.yaw_rate)

    def snapshot(self) -> Snapshot:
        """The context at this moment."""
        state = self.state() if self.odometry else None
        return Snapshot(self.stamp, state, self.alerts)

    @property
    def stamp(self) -> int:
        """Mission time in nanoseconds."""
        return round(self.time * NANOSECONDS)

    def look(self, random: np.random.Generator) -> Detections:
        """Detect the target as a perfect detector would, but for the noise of its box."""
        box = None if self.hidden(self.time) else self.box()
        items = []
        if box is not None:
            spread = self.noise * (box[3] - box[1])
            noisy = np.array(box) + random.normal(0, spread, 4)
            frame = [self.camera.width, self.camera.height] * 2
            left, top, right, bottom = np.clip(noisy, 0, frame).tolist()
            items.append(Detection((left, top, right, bottom), self.label, 0.9))
        header = Header(len(self.commands), self.stamp, "drone/cam")
        odometry = self.state() if self.odometry else None
        width, height = self.camera.width, self.camera.height
        return Detections(header, tuple(items), width, height, self.camera, odometry)

    def box(self) -> tuple[float, float, float, float] | None:
        """Project an upright plate that faces the camera; None if it is out of the picture."""
        offset = np.array([*self.target(self.time), self.target_base]) - self.position
        across = np.array([-offset[1], offset[0], 0.0]) / max(np.hypot(*offset[:2]), 1e-9)
        corners = [
            offset + side * across * self.target_width / 2 + np.array([0, 0, up])
            for side in (-1, 1)
            for up in (0.0, self.target_height)
        ]
        pixels = [self.camera.project(enu_to_body(corner, self.yaw)) for corner in corners]
        if any(depth <= 0 for _, _, depth in pixels):
            return None
        us, vs = [u for u, _, _ in pixels], [v for _, v, _ in pixels]
        left, right = max(0.0, min(us)), min(float(self.camera.width), max(us))
        top, bottom = max(0.0, min(vs)), min(float(self.camera.height), max(vs))
        return (left, top, right, bottom) if right - left > 4 and bottom - top > 4 else None

    def fly(self, command: VelocityCommand) -> None:
        """Move for one frame's time, in small steps."""
        steps = 10
        dt = 1 / self.rate / steps
        for _ in range(steps):
            self.velocity = self.velocity + (command.velocity - self.velocity) * dt / 0.3
            self.yaw_rate += (command.yaw_rate - self.yaw_rate) * dt / 0.15
            self.position = self.position + body_to_enu(self.velocity, self.yaw) * dt
            self.yaw += self.yaw_rate * dt
            self.time += dt


def vest_world(target: Path, rate: float) -> World:
    """A vest of an upright person, 4 m ahead, seen as a good detector would."""
    return World(
        target,
        np.array([0.0, 0.0, 1.5]),
        target_height=0.6,
        target_width=0.43,
        target_base=0.85,
        label="vest",
        rate=rate,
        noise=0.01,
    )
