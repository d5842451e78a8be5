"""What a recording proves about a flight: the simulator's truth, never the drone's own belief."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import seconds
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.recording.reader import Recording, vehicle_states
from aerodaas.recording.report.flight import Band, RecordedFlight, RobotFlight
from aerodaas.simulation.scenario import Building, Car, Gesture
from aerodaas.simulation.world import World

__all__ = ["Evidence"]

_AIRBORNE = 0.3
"""Metres of height from which a drone flies."""


@dataclass(frozen=True)
class Evidence:
    """A recorded flight of one simulated robot, and the world in which it took place."""

    flight: RecordedFlight
    robot: RobotFlight
    config: RobotConfig
    world: World
    time: NDArray[np.float64]
    """Mission seconds, shape (N,)."""
    position: NDArray[np.float64]
    """True ENU metres, shape (N, 3)."""
    velocity: NDArray[np.float64]
    """True ENU m/s, shape (N, 3)."""
    yaw: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """True radians counter-clockwise from east, shape (N,); empty where nobody recorded it."""

    @classmethod
    def read(cls, path: Path, robot: str | None = None) -> Evidence:
        """Read a recording; `robot` where it has several. Raises RecordingError."""
        with Recording.open(path) as recording:
            flight = RecordedFlight.read(recording)
            content = recording.attachment("environment.json").decode()
            environment = EnvironmentConfig.model_validate_json(content)
            config = next(one for one in environment.robots if robot in {None, one.id})
            rows = [
                (seconds(state.stamp), *odometry.position, *odometry.velocity, odometry.yaw)
                for _, state in vehicle_states(recording, config.id)
                for odometry in [state.truth or state.odometry]
            ]
        table = np.array(rows, dtype=np.float64).reshape(-1, 8)
        return cls(
            flight,
            flight.robots[config.id],
            config,
            World.load(environment.simulation),
            table[:, 0],
            table[:, 1:4],
            table[:, 4:7],
            table[:, 7],
        )

    @property
    def states(self) -> list[str]:
        """Mission states in their order."""
        return [band.state for band in self.robot.bands]

    @property
    def airborne(self) -> NDArray[np.bool_]:
        """When it flew, shape (N,)."""
        return np.asarray(self.position[:, 2] > _AIRBORNE)

    @property
    def duration(self) -> float:
        """Seconds from the take-off's begin until it stood again."""
        flown = [band for band in self.robot.bands if band.state not in {"idle", "preflight"}]
        on_ground = [band.start for band in flown if band.state in {"landed", "aborted"}]
        return (on_ground[0] if on_ground else flown[-1].end) - flown[0].start if flown else 0.0

    @property
    def distance(self) -> float:
        """Metres flown, by the truth."""
        return float(np.linalg.norm(np.diff(self.position, axis=0), axis=1).sum())

    def bands(self, *states: str) -> list[Band]:
        """The stretches in these states."""
        return [band for band in self.robot.bands if band.state in states]

    def during(self, *states: str, settled: float = 0.0) -> NDArray[np.bool_]:
        """When it was in these states, each without its first `settled` seconds."""
        inside = np.zeros(len(self.time), dtype=np.bool_)
        for band in self.bands(*states):
            inside |= (self.time >= band.start + settled) & (self.time <= band.end)
        return inside

    def to_thing(self, name: str) -> NDArray[np.float64]:
        """Level metres from the drone to a thing of the world, at all times, shape (N,).

        To the middle of a person or a tower, and to the nearest point of a car or a building.
        """
        thing = self.world.thing(name)
        states = [thing.state(float(time)) for time in self.time]
        way = self.position[:, :2] - np.array([(state.x, state.y) for state in states])
        if not isinstance(thing.spec, Car | Building):
            return np.asarray(np.linalg.norm(way, axis=1))
        yaw = np.array([state.yaw for state in states])
        along = np.cos(yaw) * way[:, 0] + np.sin(yaw) * way[:, 1]
        across = np.cos(yaw) * way[:, 1] - np.sin(yaw) * way[:, 0]
        beyond = np.abs(np.stack([along, across], -1)) - np.array(thing.boxes(0.0)[0].size[:2]) / 2
        return np.asarray(np.linalg.norm(np.clip(beyond, 0.0, None), axis=1))

    def gesture(self, name: str, kind: str) -> Gesture:
        """The person's gesture of this kind; raises StopIteration if there is none."""
        return next(one for one in self.world.thing(name).gestures if one.kind == kind)
