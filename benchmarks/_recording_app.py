"""What the recording benchmark flies: drones that hover, each with a camera of 720p at 30 Hz."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np

from aerodaas import AeroNavigation, Analytics, Environment, Frame, NavigationType, Waypoint
from aerodaas.analytics.base import Context
from aerodaas.cameras.base import Picture
from aerodaas.config.model import EnvironmentConfig, SensorConfig
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry

__all__ = ["RATE", "SIZE", "ReadyCamera", "build", "draw_pictures", "environment"]

SIZE = (1280, 720)
RATE = 30.0
_PICTURES = 12
_PAN = 60
"""Frames for which the camera pans over one picture, a pixel each."""


class ReadyCamera:
    """Pans over the pictures of a folder in turn, decoded beforehand: that costs a copy."""

    model: CameraModel | None = None
    finished = False
    skipped = 0

    def __init__(self, sensor: SensorConfig, environment: EnvironmentConfig) -> None:
        del environment
        self._folder = Path(sensor.settings["path"])
        self._turn = 0

    def open(self) -> None:
        """Read the pictures."""
        images = [cv2.imread(str(path)) for path in sorted(self._folder.iterdir())[:_PICTURES]]
        size = SIZE[0] + _PAN, SIZE[1]
        self._images = [
            np.asarray(cv2.resize(image, size), np.uint8) for image in images if image is not None
        ]

    def capture(self, stamp: int, pose: Odometry | None) -> Picture:  # noqa: ARG002
        """Return the next picture."""
        self._turn += 1
        picture, left = divmod(self._turn, _PAN)
        image = self._images[picture % len(self._images)][:, left : left + SIZE[0]]
        return Picture(np.ascontiguousarray(image), stamp)

    def close(self) -> None:
        """Nothing to release."""


class Seen(Analytics[int]):
    """Takes a frame and says so, so that the way of a frame is measured and nothing else."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)
    produces: ClassVar[type] = int

    def process(self, item: Frame, context: Context) -> int:  # noqa: ARG002
        """Return the frame's number."""
        return item.header.id


def draw_pictures(folder: Path) -> Path:
    """Pictures of about the detail of a photograph, for who gives none."""
    folder.mkdir(parents=True, exist_ok=True)
    generator = np.random.default_rng(0)
    width, height = SIZE
    for number in range(_PICTURES):
        image: cv2.typing.MatLike = np.zeros((height, width, 3), np.uint8)
        for scale in (4, 16, 64):
            noise = generator.integers(0, 90, (height // scale + 1, width // scale + 1, 3))
            image = cv2.add(image, cv2.resize(noise.astype(np.uint8), SIZE))
        cv2.imwrite(str(folder / f"{number:02}.png"), image)
    return folder


def environment(
    drones: int, pictures: Path, *, recorded: bool, images: str = "jpeg"
) -> dict[str, Any]:
    """The environment file's content."""
    camera = {
        "id": "camera",
        "driver": "_recording_app:ReadyCamera",
        "rate": RATE,
        "settings": {"path": str(pictures)},
    }
    return {
        "name": "recording",
        "robots": [
            {
                "id": f"drone{number}",
                "start": [0, 4 * number, 0],
                "sensors": [{**camera, "id": f"camera{number}"}],
            }
            for number in range(drones)
        ],
        "compute": [{"id": "edge", "kind": "edge"}],
        "simulation": {"world": "empty"},
        "recording": {"enabled": recorded, "images": images},
    }


def build(env: Environment, seconds: float) -> None:
    """Every drone takes off and hovers."""
    for number in range(len(env.get_env_robots())):
        drone = env.get_robot_by_id(f"drone{number}")
        frames = drone.get_sensor_by_id(f"camera{number}").get_data_stream()
        Seen().analyse(frames)
        place = Waypoint(f"here{number}", 0, 4 * number, 1.5, hover_duration=seconds)
        drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [place]))
