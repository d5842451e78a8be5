"""The data types that streams carry, each with its units.

Stamps are nanoseconds of the mission clock. Positions and velocities are ENU, metres and m/s;
angles are radians (see `aerodaas.types.geometry`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from aerodaas.types.appearance import ZONE_BYTES, ZONES, appearance_in_box
from aerodaas.types.depth import depth_in_box, nearest_in_cells
from aerodaas.types.errors import SourceError
from aerodaas.types.geometry import Box, CameraModel, Vector
from aerodaas.types.records import fast_pickle

__all__ = [
    "Alert",
    "Battery",
    "Bbox",
    "Detection",
    "Detections",
    "Frame",
    "GpsFix",
    "Header",
    "Image",
    "Odom",
    "Odometry",
    "Readings",
]

E = TypeVar("E")


class Header(NamedTuple):
    """Identity of a measurement: its source, its number, and its timestamp.

    A result carries the header of the measurement it was made from, so that its age is known
    wherever it arrives.
    """

    id: int
    """Counts up from zero within one source."""
    stamp: int
    """Mission clock at capture, in nanoseconds."""
    source: str
    """Identifier of the sensor, `robot/sensor`."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class Odometry:
    """Where the vehicle believes it is: ENU position and velocity, attitude and body rates."""

    position: Vector
    """Metres, ENU, from home."""
    velocity: Vector
    """m/s, ENU."""
    yaw: float
    """Radians, counter-clockwise from east."""
    roll: float = 0.0
    """Radians, positive with the right side down."""
    pitch: float = 0.0
    """Radians, positive with the nose down."""
    yaw_rate: float = 0.0
    """rad/s, counter-clockwise."""
    position_sigma: float = 0.0
    """Standard deviation of the position in metres, zero if the driver gives none."""

    @property
    def height(self) -> float:
        """Metres above home."""
        return float(self.position[2])


@fast_pickle
@dataclass(frozen=True, slots=True)
class GpsFix:
    """A global position: WGS84 degrees, metres above the ellipsoid, and its accuracy."""

    latitude: float
    longitude: float
    altitude: float
    horizontal_sigma: float = 0.0
    """Metres."""
    vertical_sigma: float = 0.0
    """Metres."""
    satellites: int = 0


@fast_pickle
@dataclass(frozen=True, slots=True)
class Battery:
    """State of the flight battery."""

    fraction: float
    """Charge left, 0 to 1."""
    voltage: float = 0.0
    """Volts, zero where unknown."""
    current: float = 0.0
    """Amperes drawn, zero where unknown."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class Frame:
    """An immutable image with the data needed to place it in the world."""

    header: Header
    image: NDArray[np.uint8]
    """Height x width x 3, BGR."""
    camera: CameraModel | None = None
    """Calibration and mount, where known."""
    odometry: Odometry | None = None
    """The vehicle's odometry at capture, where known."""
    depth: NDArray[np.uint16] | None = None
    """Height x width, pixel by pixel: millimetres along the optical axis, 0 where not measured.
    None from cameras that measure none."""

    def __post_init__(self) -> None:
        """Require 8-bit BGR, and depth of the image's size."""
        bgr_axes, bgr_channels = 3, 3
        image = self.image
        if image.dtype != np.uint8 or image.ndim != bgr_axes or image.shape[2] != bgr_channels:
            message = (
                f"{self.header.source}: a frame must be height x width x 3 of uint8 (BGR), "
                f"not {image.shape} of {image.dtype}"
            )
            raise SourceError(message)
        depth = self.depth
        if depth is not None and (depth.dtype != np.uint16 or depth.shape != image.shape[:2]):
            message = (
                f"{self.header.source}: depth must be height x width of uint16 (millimetres), as "
                f"the picture's {image.shape[:2]}, not {depth.shape} of {depth.dtype}"
            )
            raise SourceError(message)

    @property
    def width(self) -> int:
        """Pixels across."""
        return int(self.image.shape[1])

    @property
    def height(self) -> int:
        """Pixels down."""
        return int(self.image.shape[0])

    @property
    def nbytes(self) -> int:
        """Size in bytes of the image and its depth."""
        return self.image.nbytes + (0 if self.depth is None else self.depth.nbytes)


@fast_pickle
@dataclass(frozen=True, slots=True)
class Detection:
    """One object found in a frame; the box is in the frame's own pixels.

    Raises ValueError for key points or an appearance of another size.
    """

    box: Box
    """Left, top, right, bottom."""
    label: str
    score: float
    """Confidence, 0 to 1."""
    track_id: int | None = None
    """Identity kept by a tracker."""
    keypoints: NDArray[np.float32] | None = None
    """K x 3: pixel u, pixel v, confidence; None where the model gives none."""
    depth: float | None = None
    """Metres along the optical axis to its surface, where the camera measured that."""
    appearance: bytes | None = None
    """A person's colours, for `types.appearance.unlikeness`; None for other things."""

    def __post_init__(self) -> None:
        """Refuse what those who read them would stumble over."""
        points = self.keypoints
        # Without any, the second dimension is lost where they went through JSON.
        if points is not None and points.size and points.shape[1:] != (3,):
            raise ValueError(f"key points of shape {points.shape}, not K x 3")
        if self.appearance is not None and len(self.appearance) != ZONES * ZONE_BYTES:
            raise ValueError(f"an appearance of {len(self.appearance)} bytes")

    @property
    def centre(self) -> tuple[float, float]:
        """Pixel u and v of the middle of the box."""
        left, top, right, bottom = self.box
        return (left + right) / 2, (top + bottom) / 2

    @property
    def area(self) -> float:
        """Square pixels covered by the box."""
        left, top, right, bottom = self.box
        return max(0.0, right - left) * max(0.0, bottom - top)


@fast_pickle
@dataclass(frozen=True, slots=True)
class Detections(Sequence[Detection]):
    """All detections in one frame, best first, with that frame's metadata."""

    header: Header
    items: tuple[Detection, ...]
    width: int
    """Pixels across of the frame."""
    height: int
    """Pixels down of the frame."""
    camera: CameraModel | None = None
    odometry: Odometry | None = None
    nearest: NDArray[np.uint16] | None = None
    """Rows x columns of cells that cover the frame: millimetres along the optical axis to the
    nearest in each, 0 where nothing was measured. None where the camera measures no depth."""

    @classmethod
    def of(cls, frame: Frame, items: Iterable[Detection]) -> Detections:
        """Gather `items` found in `frame`, ordered by score, with the appearance of people.

        Each has its depth, where that is measured.
        """
        ordered = tuple(
            replace(one, appearance=appearance_in_box(frame.image, one.box, one.label))
            for one in sorted(items, key=lambda item: -item.score)
        )
        nearest = None
        if (depth := frame.depth) is not None:
            ordered = tuple(replace(one, depth=depth_in_box(depth, one.box)) for one in ordered)
            nearest = nearest_in_cells(depth)
        camera, odometry = frame.camera, frame.odometry
        return cls(frame.header, ordered, frame.width, frame.height, camera, odometry, nearest)

    def labelled(self, *labels: str) -> tuple[Detection, ...]:
        """Keep the detections with one of `labels`, best first."""
        return tuple(item for item in self.items if item.label in labels)

    @overload
    def __getitem__(self, index: int) -> Detection: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Detection, ...]: ...
    def __getitem__(self, index: int | slice) -> Detection | tuple[Detection, ...]:
        """Detection or slice of detections."""
        return self.items[index]

    def __len__(self) -> int:
        """Count the detections."""
        return len(self.items)


@fast_pickle
@dataclass(frozen=True, slots=True)
class Alert:
    """An alert for the operator: raised by monitoring, emergencies, the watchdogs."""

    header: Header
    kind: str
    """Short machine-readable name, such as `battery_low`."""
    text: str
    """One sentence for a person."""
    values: dict[str, Any] = field(default_factory=dict)
    """Figures behind it, by name, in SI units."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class Readings:
    """Readings of monitoring by name, in SI units; a compound one is `gps.latitude` and so on.

    `state` is the index of the mission's state in `MissionState`.
    """

    stamp: int
    """Mission clock, nanoseconds."""
    values: dict[str, float]


Image = Frame
"""The paper's name of a camera's item."""
Odom = Odometry
"""The paper's name of an odometry sensor's item."""
Bbox = Detections
"""The paper's name of a detector's result."""
