"""The process of a camera that decodes strangers' streams is bounded, and only that one."""

from __future__ import annotations

import resource
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import FLAT, Flyer, hop, robot

from aerodaas import Environment
from aerodaas.cameras.base import Picture
from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.messages.odometry import Odometry

_MOST = 3 << 30


class OwnCamera:
    """Notes the bound of its process as it opens."""

    model = None
    finished = False
    skipped = 0

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        del environment
        self._note = Path(sensor.settings["note"])

    def open(self) -> None:
        """Note it."""
        self._note.write_text(str(resource.getrlimit(resource.RLIMIT_DATA)[0]))

    def capture(self, stamp: int, pose: Odometry | None) -> Picture:  # noqa: ARG002
        """Show nothing."""
        return Picture(np.zeros((8, 8, 3), np.uint8), stamp)

    def close(self) -> None:
        """Nothing to release."""


class StreamCamera(OwnCamera):
    """Decodes what others send."""

    most_memory = _MOST


@pytest.mark.slow
def test_the_sensors_process_is_bounded_before_the_camera_opens(flyer: Flyer) -> None:
    """By what its camera says; one that says nothing may take what it needs."""
    own, stream = flyer.folder / "own", flyer.folder / "stream"
    sensors: list[dict[str, Any]] = [
        {"id": "own", "driver": f"{__name__}:OwnCamera", "settings": {"note": str(own)}},
        {"id": "stream", "driver": f"{__name__}:StreamCamera", "settings": {"note": str(stream)}},
    ]

    def build(env: Environment) -> None:
        drone = env.get_robot_by_id("drone")
        for name in ("own", "stream"):
            drone.get_sensor_by_id(name).get_data_stream()
        drone.navigate(hop((1, 0)))

    flyer.fly(build, {**FLAT, "robots": [robot(sensors=sensors)]}, speed=5.0)
    before = resource.getrlimit(resource.RLIMIT_DATA)[0]
    assert int(own.read_text()) == before
    assert _MOST < int(stream.read_text()) < 2 * _MOST
