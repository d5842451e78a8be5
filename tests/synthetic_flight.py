"""A farm survey as the streams would carry it, without any of the machinery that flies it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from aerodaas.config.model import GeofenceConfig, RecordingConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.geometry.frames import CameraModel, GeodeticOrigin
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import (
    BatteryOutlook,
    Decision,
    MissionState,
    MissionStatus,
    SetpointRecord,
)
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import PositionSetpoint, VehicleMode, VehicleState, VelocitySetpoint
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.recording.output import RecordingSummary
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.recorder import FlightRecorder

MILLISECOND = 1_000_000
HOME = GeodeticOrigin(12.97, 77.59, 900.0)
FENCE = GeofenceConfig(polygon=[(-3, -3), (13, -3), (13, 13), (-3, 13)], ceiling=20.0)
CAMERA = CameraModel.from_fov(320, 180, 1.4, mount=(0.1, 0.0, 0.0), pitch=0.3)
PLAN = tuple(
    Waypoint(name, x, y, 1.5, hover_duration=5.0, waypoint_type="local")
    for name, x, y in (("north", 0, 10), ("far", 10, 10), ("east", 10, 0), ("start", 0, 0))
)
SPEED = 0.5
PROVENANCE = Provenance(
    started_ns=1_750_000_000_000_000_000,
    name="farm_survey",
    seed=7,
    config='{"name": "field", "home": {"latitude": 12.97, "longitude": 77.59, "altitude": 900}}',
    app="farm_survey.py",
    app_source="drone.start_mission()\n",
    versions={"aerodaas": "0.1.0"},
)


@dataclass
class Step:
    """One moment of the flight."""

    time: float
    position: np.ndarray[Any, np.dtype[np.float64]]
    velocity: np.ndarray[Any, np.dtype[np.float64]]
    yaw: float
    status: MissionStatus


@dataclass
class SyntheticFlight:
    """Messages of one robot's flight, in order of mission time; the same seed, the same flight."""

    robot: str = "tello"
    seed: int = 0
    rate: float = 20.0
    frames: float = 0.0
    """Frames per second; none by default, for they take the longest."""
    offset: tuple[float, float] = (0.0, 0.0)
    hover: float = 5.0
    _seq: dict[str, int] = field(default_factory=dict)

    def steps(self) -> Iterator[Step]:
        """The truth of the flight: climb, four legs with hovers, descent."""
        time, distance = 0.0, 0.0
        height = np.array([0.0, 0.0, 1.5])
        at = np.array([*self.offset, 0.0])
        visited: tuple[str, ...] = ()
        plan = [
            Waypoint(
                leg.id,
                leg.x + self.offset[0],
                leg.y + self.offset[1],
                leg.z,
                self.hover,
                "local",
            )
            for leg in PLAN
        ]
        legs: list[tuple[MissionState, str, Any, float, Waypoint | None]] = [
            (MissionState.PREFLIGHT, "checks passed", at, 0.5, None),
            (MissionState.TAKING_OFF, "climbing to 1.5 m", at + height, 2.0, None),
        ]
        corner = at + height
        for leg in plan:
            length = float(np.linalg.norm(leg.position - corner))
            legs.append((MissionState.ENROUTE, f"to {leg.id}", leg.position, length / SPEED, leg))
            legs.append((MissionState.LOITERING, f"at {leg.id}", leg.position, self.hover, leg))
            corner = leg.position
        legs.append((MissionState.LANDING, "all waypoints visited", at, 3.0, None))
        legs.append((MissionState.LANDED, "mission complete", at, 0.5, None))
        for state, reason, goal, duration, target in legs:
            count = max(1, round(duration * self.rate))
            start = at
            velocity = (goal - start) / duration
            yaw = float(np.arctan2(velocity[1], velocity[0])) if target else 0.0
            if state is MissionState.LOITERING and target:
                visited = (*visited, target.id)
            for step in range(count):
                at = start + (goal - start) * (step + 1) / count
                distance += float(np.linalg.norm(velocity)) / self.rate
                time += 1 / self.rate
                ahead = tuple(w for w in plan if w.id not in visited and w is not target)
                status = MissionStatus(
                    round(time * 1e9),
                    state,
                    reason,
                    target,
                    ahead,
                    visited,
                    (),
                    distance,
                    visits=len(visited),
                    waypoint_counts=(len(visited), len(plan)),
                    outlook=_outlook(state, time),
                )
                yield Step(time, at, velocity, yaw, status)

    def messages(self) -> Iterator[Message[Any]]:
        """What the streams carry."""
        rng = np.random.default_rng(self.seed)
        next_frame = 0.0
        for count, step in enumerate(self.steps()):
            stamp = round(step.time * 1e9)
            noise = rng.normal(0, 0.02, 3)
            odometry = Odometry(step.position + noise, step.velocity, step.yaw, 0.01, 0.02)
            truth = Odometry(step.position, step.velocity, step.yaw)
            charge = 0.97 - 0.004 * step.time
            yield self.message("@state", stamp, self._state(stamp, odometry, truth, charge))
            yield self.message("mission", stamp, step.status)
            yield self.message("@setpoints", stamp, self._setpoint(stamp, step))
            if self.frames and step.time >= next_frame:
                next_frame += 1 / self.frames
                yield from self._seen(stamp, odometry, rng)
            if count == round(20 * self.rate):
                header = Header(count, stamp, f"{self.robot}/monitor")
                alert = Alert(header, "battery_low", "the battery is at 20 %", {"fraction": 0.2})
                yield self.message("monitor", stamp, alert)

    def message(
        self,
        stream: str,
        stamp: int,
        item: object,
        spans: tuple[TraceSpan, ...] = (),
        captured: int = 0,
    ) -> Message[Any]:
        """Wrap an item."""
        name = f"{self.robot}/{stream}"
        seq = self._seq.get(name, 0)
        self._seq[name] = seq + 1
        return Message(name, seq, stamp, Header(seq, stamp, name), captured, spans, item)

    def _state(self, stamp: int, seen: Odometry, truth: Odometry, charge: float) -> VehicleState:
        latitude, longitude, altitude = HOME.to_geodetic(seen.position)
        return VehicleState(
            stamp,
            seen,
            Battery(charge, 3.7 + charge / 2, 4.0),
            VehicleMode.GUIDED,
            armed=True,
            gps=GpsFix(latitude, longitude, altitude, 1.0, 2.0, 12),
            truth=truth,
        )

    def _setpoint(self, stamp: int, step: Step) -> SetpointRecord:
        asked = PositionSetpoint(step.position, None, SPEED)
        return SetpointRecord(stamp, asked, VelocitySetpoint(step.velocity), ("max_speed",))

    def _seen(
        self, stamp: int, odometry: Odometry, rng: np.random.Generator
    ) -> Iterator[Message[Any]]:
        number = self._seq.get(f"{self.robot}/camera", 0)
        header = Header(number, stamp, f"{self.robot}/camera")
        frame = Frame(header, _picture(odometry), CAMERA, odometry)
        begin = round(stamp + 1e12)
        camera = TraceSpan("camera", begin + MILLISECOND, begin + 2 * MILLISECOND)
        yield self.message("camera", stamp, frame, (camera,), begin)
        keypoints = rng.uniform(20, 160, (17, 3)).astype(np.float32)
        keypoints[:, 2] = 0.9
        box = (100.0, 50.0, 140.0, 130.0)
        found = Detections.of(frame, [Detection(box, "person", 0.91, 3, keypoints)])
        waited = round(rng.gamma(2.0, 0.4) * MILLISECOND)
        worked = round((14 + rng.gamma(3.0, 1.0)) * MILLISECOND)
        at = camera.published + waited
        detector = TraceSpan("detector", at, at + worked)
        later = stamp + 20 * MILLISECOND
        yield self.message("detector", later, found, (camera, detector), begin)
        command = AeroNavigation(
            NavigationType.ANALYTICS_DRIVEN, [VelocityCommand(forward=0.2, yaw_rate=0.1)]
        )
        follow = TraceSpan("follow", detector.published + 300_000, detector.published + 600_000)
        yield self.message("follow", later, command, (camera, detector, follow), begin)
        decision = Decision(later, f"detector#{number}", "edge", "in time", {"slack": 0.1})
        yield self.message("dispatcher", later, decision)


def _picture(odometry: Odometry) -> np.ndarray[Any, np.dtype[np.uint8]]:
    image = np.full((180, 320, 3), (90, 160, 110), np.uint8)
    at = (160 + round(10 * odometry.position[0]), 60 + round(6 * odometry.position[1]))
    cv2.circle(image, at, 25, (40, 90, 200), -1)
    return image


def _outlook(state: MissionState, time: float) -> BatteryOutlook | None:
    """Ten minutes from the first second on; no battery has what landing takes."""
    if state in {MissionState.ENROUTE, MissionState.LOITERING}:
        return BatteryOutlook(plan=0.2, returns_at=0.1, hover=600.0 - time)
    return BatteryOutlook(math.inf, 1.0, 0.0) if state is MissionState.LANDING else None


def record(
    path: Path,
    *flights: SyntheticFlight,
    config: RecordingConfig | None = None,
    drops: int = 0,
) -> RecordingSummary:
    """Record flights, interleaved by time, into a new file."""
    fences = {flight.robot: FENCE for flight in flights}
    everything = [message for flight in flights for message in flight.messages()]
    with FlightRecorder(
        path, config=config or RecordingConfig(), provenance=PROVENANCE, home=HOME, fences=fences
    ) as recorder:
        for message in sorted(everything, key=lambda message: message.stamp):
            recorder.write(message)
        if drops:
            recorder.drops("tello/camera", drops)
        return recorder.close()
