"""What a vehicle carries to look with: a gimbal that is aimed, a camera that takes pictures.

A driver implements `Gimbal` and `PhotoCamera`, and hands them out as a
`aerodaas.messages.vehicle.PayloadVehicle`.

Angles are those of surveyors and ground stations: pitch is
zero at the horizon and negative downwards (-pi/2 looks straight down), yaw is zero along the
vehicle's nose and positive counter-clockwise, radians. A gimbal keeps pitch and roll to the
horizon while the vehicle tilts; only its yaw turns along.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Protocol, TypeAlias, runtime_checkable

from aerodaas.geometry.frames import CameraModel, angles_of_rotation, rotation_from_rpy
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.serialization.json_types import Int64, Real
from aerodaas.messages.serialization.records import fast_pickle

__all__ = [
    "CameraStatus",
    "Gimbal",
    "GimbalAttitude",
    "GimbalTarget",
    "LensCamera",
    "LensTarget",
    "Photo",
    "PhotoCamera",
    "PhotoFailure",
    "PhotoOutcome",
    "PhotoPlace",
    "VideoCamera",
    "levelled",
    "zoomed",
]


@fast_pickle
@dataclass(frozen=True, slots=True)
class GimbalTarget:
    """Where a gimbal is to look; radians."""

    pitch: float = 0.0
    """Negative looks down."""
    yaw: float = 0.0
    """From the vehicle's nose, counter-clockwise."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class LensTarget:
    """Zoom and focus for a camera's lens; percent of its range."""

    zoom: float | None = None
    """0 sees most, 100 least; None leaves it."""
    focus: float | None = None
    """0 is the nearest place that it can focus on, 100 the farthest; None leaves it."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class GimbalAttitude:
    """Where a gimbal says that it looks; radians."""

    stamp: Int64
    """Mission clock when it said so, nanoseconds."""
    pitch: Real
    """Negative looks down."""
    yaw: Real
    """From the vehicle's nose, counter-clockwise, in (-pi, pi]."""
    roll: Real = 0.0
    """Positive with the right side of the picture down."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class PhotoPlace:
    """Where on the earth a picture was taken: WGS84 degrees and metres."""

    latitude: float
    longitude: float
    altitude: float | None
    """None where it is not known."""
    datum: Literal["ellipsoid", "sea"] = "ellipsoid"
    """What the altitude is counted from."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class Photo:
    """One picture that was taken, by what camera and vehicle say; the pixels are not in it."""

    number: int | None
    """That of `PhotoCamera.take_photo`; None for a picture that nobody here asked for."""
    stamp: Int64
    """Mission clock at exposure, nanoseconds."""
    label: str = ""
    """What it was taken for, such as a waypoint's id."""
    place: PhotoPlace | None = None
    """None where neither camera nor vehicle knows it."""
    odometry: Odometry | None = None
    """Where the vehicle believed to be at exposure."""
    gimbal: GimbalAttitude | None = None
    """Where the camera looked; None for one that is bolted to the vehicle."""
    truth: Odometry | None = None
    """The simulator's exact state at exposure, by which the picture is rendered."""
    file: str = ""
    """Name or URL by which the camera itself keeps it; empty where it tells none."""
    zoom: float | None = None
    """Percent of the lens's range; None where it is not known, and for a lens without."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class PhotoFailure:
    """A picture that was asked for and will not come."""

    number: int
    """That of `PhotoCamera.take_photo`."""
    reason: str
    """In a few words."""


@dataclass(frozen=True, slots=True)
class CameraStatus:
    """Model and activity of a camera; None is not known."""

    name: str
    """By which people know it, such as `camera (component 100)`."""
    model: str = ""
    pixels: tuple[int, int] | None = None
    """Width and height of its pictures."""
    view: float | None = None
    """Degrees across its picture."""
    free: float | None = None
    """MiB that its card has left."""
    trouble: str = ""
    """Why it keeps no pictures, or soon will not; empty if it does."""
    taken: int | None = None
    """Pictures by its own count."""
    interval: float | None = None
    """Seconds between pictures that it takes by itself, 0 where it does not say; None while it
    takes none."""
    recording: float | None = None
    """Seconds for which it has been recording video; None while it records none."""

    def __str__(self) -> str:
        """One line for people, without its name."""
        said = [self.model]
        if self.pixels is not None:
            said.append(f"{self.pixels[0]}x{self.pixels[1]}")
        if self.view is not None:
            said.append(f"sees {self.view:.0f} degrees across")
        if self.free is not None:
            said.append(f"{self.free:.0f} MiB free")
        if self.taken is not None:
            said.append(f"{self.taken} pictures taken")
        if self.interval is not None:
            said.append(f"takes one every {self.interval:g} s" if self.interval else "takes more")
        if self.recording is not None:
            said.append(f"has been recording for {self.recording:.0f} s")
        return ", ".join(one for one in said if one) or "tells nothing of itself"


PhotoOutcome: TypeAlias = Photo | PhotoFailure


class Gimbal(Protocol):
    """A gimbal; every method returns at once."""

    def aim(self, target: GimbalTarget) -> GimbalTarget:
        """Have it turn to `target`; returns the target after clipping to its range.

        The driver repeats what is not acknowledged. Progress shows in `attitude`, and a refusal
        in `fault`. Raises VehicleError if it certainly cannot.
        """
        ...

    @property
    def attitude(self) -> GimbalAttitude | None:
        """The newest that it said; None before the first, and after nonsense."""
        ...

    @property
    def fault(self) -> str:
        """Why it did not take the last command, in a few words; empty if nothing is known."""
        ...


class PhotoCamera(Protocol):
    """A camera that takes single pictures; every method returns at once."""

    def take_photo(self, label: str) -> int:
        """Ask for one picture, for what `label` says; returns a number of this request alone.

        The driver repeats what is not acknowledged, and never takes two pictures for one request
        where the camera can tell. Raises VehicleError if it certainly cannot.
        """
        ...

    def outcomes(self) -> list[PhotoOutcome]:
        """Pictures taken, by request or not, and requests that failed, since the last call."""
        ...


@runtime_checkable
class LensCamera(PhotoCamera, Protocol):
    """A camera whose lens zooms or focuses; every method returns at once."""

    def adjust(self, target: LensTarget) -> None:
        """Have the lens set to `target`.

        The driver repeats what is not acknowledged. Raises VehicleError if it certainly cannot.
        """
        ...

    @property
    def adjusted(self) -> bool:
        """Whether the last target was acknowledged."""
        ...

    @property
    def lens_fault(self) -> str:
        """Why the last target was not taken, in a few words; empty if nothing is known."""
        ...


@runtime_checkable
class VideoCamera(PhotoCamera, Protocol):
    """A camera that records video on its own card; every method returns at once."""

    def film(self, on: bool) -> None:  # noqa: FBT001 - it is all that is said
        """Have a recording begun, or ended; nothing changes where it is so already.

        The driver repeats what is not acknowledged. Raises VehicleError if it certainly cannot.
        """
        ...

    @property
    def filming(self) -> bool | None:
        """Whether it records, by its newest word; None while that is not known.

        It is not known from an order until the camera has acknowledged it.
        """
        ...

    @property
    def film_fault(self) -> str:
        """Why the camera refused the last order, or how it belies its acknowledgement.

        In a few words; empty if nothing is known.
        """
        ...


def zoomed(camera: CameraModel, factor: float) -> CameraModel:
    """A camera with a zoomed lens.

    Args:
        camera: The camera, not zoomed.
        factor: Ratio of its new focal length to the former.
    """
    return replace(camera, fx=camera.fx * factor, fy=camera.fy * factor)


def levelled(camera: CameraModel, attitude: GimbalAttitude, vehicle: Odometry) -> CameraModel:
    """A camera as the gimbal holds it.

    The gimbal turns about the camera's own centre, so that its place in the body stays.

    Args:
        camera: The camera on the vehicle.
        attitude: Attitude of the gimbal, radians.
        vehicle: Odometry of the vehicle, with its attitude.
    """
    look = rotation_from_rpy(attitude.roll, -attitude.pitch, vehicle.yaw + attitude.yaw)
    body = rotation_from_rpy(vehicle.roll, vehicle.pitch, vehicle.yaw)
    roll, pitch, yaw = angles_of_rotation(body.T @ look)
    return replace(camera, roll=roll, pitch=pitch, yaw=yaw)
