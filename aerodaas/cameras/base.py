"""The Camera protocol, common to simulated cameras, image folders, videos and live streams."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import GimbalAttitude
from aerodaas.messages.serialization.records import valued

__all__ = [
    "Camera",
    "GimballedCamera",
    "Picture",
    "VehicleAddressedCamera",
    "ZoomingCamera",
    "most_memory",
]


@valued
@dataclass(frozen=True, slots=True)
class Picture:
    """An image of a camera with its timestamp."""

    image: NDArray[np.uint8]
    """Pixels, height x width x 3, BGR."""
    stamp: int
    """Mission time at capture, nanoseconds."""
    label: str = ""
    """Source of the image, such as a file name."""
    odometry: Odometry | None = None
    """Odometry of the vehicle at capture; None if the source has none, so that the vehicle's newest
    applies."""
    depth: NDArray[np.uint16] | None = None
    """Depth of each pixel, as in a `Frame`; None for cameras without depth."""


@runtime_checkable
class Camera(Protocol):
    """A source of images, whose newest one is polled at the sensor's rate."""

    @property
    def model(self) -> CameraModel | None:
        """Calibration and mount; None if unknown."""
        ...

    @property
    def finished(self) -> bool:
        """Whether the source has ended and will return no more images."""
        ...

    def open(self) -> None:
        """Start the source.

        Raises:
            SourceError: If it cannot be started, naming the source and the remedy.
        """
        ...

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Return the newest image; a broken one is skipped and counted in `skipped`.

        Args:
            stamp: Present mission time, nanoseconds.
            pose: True pose of the vehicle that carries the camera, used only by simulated cameras.

        Returns:
            The newest image with its timestamp, or None if there is no new one.
        """
        ...

    @property
    def skipped(self) -> int:
        """Number of images that could not be decoded."""
        ...

    def close(self) -> None:
        """Release the source."""
        ...


@runtime_checkable
class GimballedCamera(Camera, Protocol):
    """A camera whose view the vehicle's gimbal turns."""

    def follow_gimbal(self, attitude: GimbalAttitude | None) -> None:
        """Look as the gimbal does at the next image; None: as mounted."""
        ...


@runtime_checkable
class ZoomingCamera(Camera, Protocol):
    """A camera whose view the vehicle's lens narrows."""

    def follow_zoom(self, percent: float | None) -> None:
        """See as the lens does at the next image, percent of its range; None: as calibrated."""
        ...


@runtime_checkable
class VehicleAddressedCamera(Camera, Protocol):
    """A camera whose video's address the vehicle may tell."""

    def follow_video(self, address: str) -> None:
        """Read from there, where the settings say so; empty: the vehicle tells none."""
        ...


def most_memory(camera: Camera) -> int | None:
    """Bytes that the process of `camera` may allocate from `open` on; None for any number.

    A camera that decodes what a stranger may send has an attribute `most_memory`: libraries for
    streams take whatever memory the stream asks for.
    """
    most: int | None = getattr(camera, "most_memory", None)
    return most
