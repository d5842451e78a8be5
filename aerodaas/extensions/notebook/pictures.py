"""Pictures with boxes that draw themselves after a cell."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import seconds
from aerodaas.errors import RecordingError
from aerodaas.messages.detections import Detection
from aerodaas.messages.frames import Frame
from aerodaas.recording.pictures import detections_by_frame, picture_topics, shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.overlay import draw_detections
from aerodaas.recording.report.page.document import render_page

__all__ = ["Picture", "Pictures", "boxed", "recorded_pictures"]

_QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 85]


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture, drawn over."""

    image: NDArray[np.uint8]
    """Height x width x 3, BGR."""
    caption: str

    def jpeg(self) -> bytes:
        """The picture as JPEG."""
        return bytes(cv2.imencode(".jpg", self.image, _QUALITY)[1])


class Pictures(tuple[Picture, ...]):
    """Pictures that a notebook shows side by side, in as many rows as they need."""

    __slots__ = ()

    def __repr__(self) -> str:
        """Their captions, where nothing can be drawn."""
        return f"Pictures({', '.join(one.caption for one in self)})"

    def _repr_html_(self) -> str:
        return render_page(Path(__file__).with_name("pictures.html"), pictures=self)


def boxed(frame: Frame, found: Iterable[Detection] = ()) -> Pictures:
    """A frame with boxes, labels and keypoints drawn in, in the frame's own pixels.

    Args:
        frame: Of a camera's stream; it is not changed.
        found: What was found in it, such as a detector's `Detections`.
    """
    return Pictures([_drawn(frame.image, found, frame.header.source, frame.header.stamp)])


def recorded_pictures(recording: str | Path, camera: str | None = None, count: int = 6) -> Pictures:
    """Pictures of a recorded flight, evenly over its time, with what was found in them.

    Args:
        recording: The MCAP file.
        camera: `robot/sensor`; None: the first camera.
        count: How many, from 1; fewer if there are fewer.

    Raises:
        RecordingError: If the file cannot be read, or holds no pictures of this camera.
    """
    with Recording.open(recording) as opened:
        topics = picture_topics(opened)
        named = [one for one in topics if camera is None or f"/{camera}" in {one, _stream(one)}]
        if not named:
            known = ", ".join(_stream(one).removeprefix("/") for one in topics) or "none"
            wanted = f" of {camera}" if camera is not None else ""
            raise RecordingError(f"{recording} holds no pictures{wanted}; it has: {known}")
        found = detections_by_frame(opened)
        number = opened.topics[named[0]].count
        # Every so many, the first one half a step from the beginning.
        step = max(1.0, number / count)
        wanted_places = {int((place + 0.5) * step) for place in range(min(count, number))}
        pictures = []
        for place, shot in enumerate(shots(opened, named[:1])):
            image = shot.image() if place in wanted_places else None
            if image is not None:
                header = shot.header
                boxes = found.get((header.source, header.stamp), ())
                pictures.append(_drawn(image, boxes, header.source, header.stamp))
    return Pictures(pictures)


def _stream(topic: str) -> str:
    return topic.removesuffix("/image")


def _drawn(
    image: NDArray[np.uint8], found: Iterable[Detection], source: str, stamp: int
) -> Picture:
    image, boxes = image.copy(), list(found)
    draw_detections(image, boxes)
    said = ", ".join(f"{one.label} {one.score:.2f}" for one in boxes)
    return Picture(image, f"{source}, {seconds(stamp):.1f} s{': ' if said else ''}{said}")
