"""Cameras, analyses and flights of the cluster benchmarks: next to no computation of their own."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from aerodaas import (
    AeroNavigation,
    Analytics,
    Environment,
    Frame,
    NavigableAnalytics,
    NavigationType,
    Odometry,
    VelocityCommand,
    Waypoint,
)
from aerodaas.analytics.base import Context
from aerodaas.cameras.base import Picture
from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.config.options import RunOptions, current_options
from aerodaas.geometry.frames import CameraModel

__all__ = ["NoiseCamera", "Steer", "Work", "environment", "flying", "hover"]


class NoiseCamera:
    """Pictures of noise, the worst case of any compression; `width` and `height` are settings."""

    model: CameraModel | None = None
    finished = False
    skipped = 0

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        size = (int(sensor.settings["height"]), int(sensor.settings["width"]), 3)
        self._shape, self._seed = size, environment.simulation.seed

    def open(self) -> None:
        """Draw the picture once."""
        generator = np.random.default_rng(self._seed)
        self._image = generator.integers(0, 255, self._shape, dtype=np.uint8)

    def capture(self, stamp: int, pose: Odometry | None) -> Picture:  # noqa: ARG002
        """Return the picture."""
        return Picture(self._image, stamp)

    def close(self) -> None:
        """Nothing to release."""


class Work(Analytics[int]):
    """Stands for an inference: takes its time on an accelerator, not on a core."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = int
    isolated = True

    def __init__(self, seconds: float, *, scheduled: bool = False, name: str = "work") -> None:
        """Take so many `seconds` for each frame."""
        self.name = name
        self.scheduled = scheduled
        self._seconds = seconds

    def process(self, item: Frame, context: Context) -> int:  # noqa: ARG002
        """Return the frame's number."""
        time.sleep(self._seconds)
        return item.header.id


class Steer(NavigableAnalytics):
    """Turns each result into a command, so that the drone's actor sees when it arrives."""

    accepts: ClassVar[tuple[type, ...]] = (int,)

    def process(self, item: int, context: Context) -> AeroNavigation:  # noqa: ARG002
        """Stand still."""
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [VelocityCommand(valid_for=1.0)])


def environment(
    drones: int, rate: float, size: tuple[int, int], *, cloud: bool, tasks: dict[str, Any]
) -> dict[str, Any]:
    """An environment file of so many drones with one camera each."""
    camera = f"{NoiseCamera.__module__}:{NoiseCamera.__name__}"
    settings = {"width": size[0], "height": size[1]}
    robots = [
        {
            "id": f"drone{number}",
            "start": [10.0 * number, 0.0, 0.0],
            "sensors": [
                {
                    "id": f"camera{number}",
                    "type": "camera",
                    "driver": camera,
                    "rate": rate,
                    "settings": settings,
                }
            ],
        }
        for number in range(drones)
    ]
    compute: list[dict[str, Any]] = [{"id": "edge", "kind": "edge"}]
    # Noise only grows by any compression.
    far = {"id": "cloud", "kind": "cloud", "executors": 16, "compression": "none"}
    compute += [far] if cloud else []
    return {
        "robots": robots,
        "compute": compute,
        "schedulers": {"tasks": tasks},
        "simulation": {"world": "empty"},
        "recording": {"enabled": False},
    }


@contextmanager
def flying(
    content: dict[str, Any],
    folder: Path,
    address: str,
    **words: Any,  # noqa: ANN401
) -> Iterator[Environment]:
    """An environment whose drones land when it is left; to be given a graph and launched inside."""
    path = folder / f"environment-{time.monotonic_ns()}.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    options = RunOptions(speed=1.0, simulated_time=False, view=False, address=address, **words)
    current_options.set(options)
    env = Environment(path)
    try:
        yield env
    finally:
        if env.run is not None:
            for robot in content["robots"]:
                env.get_robot_by_id(robot["id"]).end_mission()
            env.run.wait()


def hover(env: Environment, robot: str) -> None:
    """Have a drone hover over its place until told otherwise."""
    drone = env.get_robot_by_id(robot)
    east = drone.config.start[0]
    places = [Waypoint(f"above-{robot}", east, 0.0, 2.0, hover_duration=3600.0)]
    drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, places))
