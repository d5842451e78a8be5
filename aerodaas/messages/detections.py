"""Objects that a detector found in a frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, overload

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.depth import depth_in_box, nearest_in_cells
from aerodaas.geometry.frames import Box, CameraModel
from aerodaas.messages.appearance import ZONE_BYTES, ZONES, appearance_in_box
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.serialization.json_types import Int64, NestedLists, Real
from aerodaas.messages.serialization.records import fast_pickle

__all__ = ["Bbox", "Detection", "Detections"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class Detection:
    """One object found in a frame; the box is in the frame's own pixels.

    Raises ValueError for key points or an appearance of another size.
    """

    box: Box
    """Left, top, right, bottom."""
    label: str
    score: Real
    """Confidence, 0 to 1."""
    track_id: Int64 | None = None
    """Identity kept by a tracker."""
    keypoints: Annotated[NDArray[np.float32], NestedLists(np.float32, 3)] | None = None
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
    width: Int64
    """Pixels across of the frame."""
    height: Int64
    """Pixels down of the frame."""
    camera: CameraModel | None = None
    odometry: Odometry | None = None
    nearest: Annotated[NDArray[np.uint16], NestedLists(np.uint16)] | None = None
    """Rows x columns of cells that cover the frame: millimetres along the optical axis to the
    nearest in each, 0 where nothing was measured. None where the camera measures no depth."""

    @classmethod
    def of(cls, frame: Frame, items: Iterable[Detection]) -> Detections:
        """Gather detections, ordered by score, with the appearance of people.

        Each has its depth, where that is measured.

        Args:
            frame: Frame in which they are found.
            items: The detections.
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


Bbox = Detections
"""The paper's name of a detector's result."""
