"""Words of a gimbal and a camera on board: where it looks, pictures taken, status.

Angles are those of surveyors and ground stations: pitch is
zero at the horizon and negative downwards (-pi/2 looks straight down), yaw is zero along the
vehicle's nose and positive counter-clockwise, radians. A gimbal keeps pitch and roll to the
horizon while the vehicle tilts; only its yaw turns along.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from aerodaas.geometry.frames import CameraModel, angles_of_rotation, rotation_from_rpy
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.serialization.json_types import Int64, Real
from aerodaas.messages.serialization.records import fast_pickle

__all__ = [
    "CameraStatus",
    "GimbalAttitude",
    "Photo",
    "PhotoPlace",
    "levelled",
    "zoomed",
]


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
