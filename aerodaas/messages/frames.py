"""Camera frames, and the header that a measurement shares with its results.

Stamps are nanoseconds of the mission clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from aerodaas.errors import SourceError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.serialization.json_types import Int64
from aerodaas.messages.serialization.records import fast_pickle

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

__all__ = ["Frame", "Header", "Image"]


class Header(NamedTuple):
    """Identity of a measurement: its source, its number, and its timestamp.

    A result carries the header of the measurement it was made from, so that its age is known
    wherever it arrives.
    """

    id: Int64
    """Counts up from zero within one source."""
    stamp: Int64
    """Mission clock at capture, in nanoseconds."""
    source: str
    """Identifier of the sensor, `robot/sensor`."""

    def __reduce__(self) -> tuple[type[Header], tuple[int | str, ...]]:
        """Pickle it by its fields, at half the cost of a named tuple's own way."""
        return Header, tuple(self)

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Schema by which pydantic reads and writes it as an object, as a dataclass."""
        from pydantic_core import core_schema  # noqa: PLC0415 - slow to load

        del source
        fields = core_schema.typed_dict_schema(
            {
                name: core_schema.typed_dict_field(handler.generate_schema(kind), required=True)
                for name, kind in get_type_hints(cls, include_extras=True).items()
            }
        )
        written = core_schema.plain_serializer_function_ser_schema(cls._asdict)
        return core_schema.no_info_after_validator_function(
            lambda value: cls(**value), fields, serialization=written
        )


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


Image = Frame
"""The paper's name of a camera's item."""
