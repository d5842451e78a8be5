"""The Camera protocol: simulated, folder of pictures, video and streams look the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from aerodaas.types.data import Odometry
from aerodaas.types.geometry import CameraModel
from aerodaas.types.records import valued

__all__ = ["Camera", "Picture"]


@valued
@dataclass(frozen=True, slots=True)
class Picture:
    """What a camera gives: pixels, and when they were taken."""

    image: NDArray[np.uint8]
    """Height x width x 3, BGR."""
    stamp: int
    """Mission clock at capture, in nanoseconds."""
    label: str = ""
    """Where it came from, such as a file's name."""
    odometry: Odometry | None = None
    """The vehicle's at capture where the source knows it; None: the vehicle's newest is it."""
    depth: NDArray[np.uint16] | None = None
    """Of each pixel, as in a `Frame`; None from cameras that measure none."""


@runtime_checkable
class Camera(Protocol):
    """A source of pictures that is asked for its newest one at the sensor's rate."""

    @property
    def model(self) -> CameraModel | None:
        """Calibration and mount, where known."""
        ...

    @property
    def finished(self) -> bool:
        """True once the source has ended and will give no more pictures."""
        ...

    def open(self) -> None:
        """Start the source; raise SourceError that names the place and the remedy."""
        ...

    def capture(self, stamp: int, pose: Odometry | None) -> Picture | None:
        """Return the newest picture at mission time `stamp`, or None if there is no new one.

        `pose` is the true pose of the vehicle that carries the camera; only simulated cameras
        use it. A picture that is broken is skipped and counted in `skipped`.
        """
        ...

    @property
    def skipped(self) -> int:
        """Pictures that could not be read."""
        ...

    def close(self) -> None:
        """Release the source."""
        ...
