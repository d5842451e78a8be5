"""What a vehicle carries to look with: a gimbal that is aimed, a camera that takes pictures.

A driver implements `Gimbal` and `PhotoCamera`, and hands them out as a `Payload` among its
`equipment` (`aerodaas.messages.vehicle.equipment_of`). Angles are those of
`aerodaas.messages.payload`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeAlias, runtime_checkable

from aerodaas.messages.payload import GimbalAttitude, Photo

__all__ = [
    "Gimbal",
    "GimbalTarget",
    "LensCamera",
    "LensTarget",
    "Payload",
    "PhotoCamera",
    "PhotoFailure",
    "PhotoOutcome",
    "VideoCamera",
]


@dataclass(frozen=True, slots=True)
class GimbalTarget:
    """Where a gimbal is to look; radians."""

    pitch: float = 0.0
    """Negative looks down."""
    yaw: float = 0.0
    """From the vehicle's nose, counter-clockwise."""


@dataclass(frozen=True, slots=True)
class LensTarget:
    """Zoom and focus for a camera's lens; percent of its range."""

    zoom: float | None = None
    """0 sees most, 100 least; None leaves it."""
    focus: float | None = None
    """0 is the nearest place that it can focus on, 100 the farthest; None leaves it."""


@dataclass(frozen=True, slots=True)
class PhotoFailure:
    """A picture that was asked for and will not come."""

    number: int
    """That of `PhotoCamera.take_photo`."""
    reason: str
    """In a few words."""


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


@runtime_checkable
class Payload(Protocol):
    """Gimbal and camera for pictures of one vehicle.

    Both may be found late and vanish in flight, so they are asked for each time.
    """

    @property
    def gimbal(self) -> Gimbal | None:
        """Its gimbal; None if there is none, none yet, or none any more."""
        ...

    @property
    def photo_camera(self) -> PhotoCamera | None:
        """Its camera; None if there is none, none yet, or none any more."""
        ...
