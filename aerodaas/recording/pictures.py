"""Images, cameras and detections of a recording, decoded to the types of the streams."""

from __future__ import annotations

import logging
import math
from collections import defaultdict, deque
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.cameras.images import (
    IMAGE_SCHEMAS,
    VIDEO_SCHEMAS,
    decode_depth,
    decode_image,
    picture_bytes,
    picture_field,
)
from aerodaas.errors import SourceError
from aerodaas.geometry.frames import CameraModel, angles_of_rotation
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.recording.converters.h264 import H264Decoder, is_key_frame
from aerodaas.recording.decoding.limits import MAX_VIDEO_GROUP
from aerodaas.recording.messages import FrameInfo
from aerodaas.recording.reader import Record, Recording
from aerodaas.recording.reference_frames import OPTICAL, Rotation, compose

__all__ = [
    "CALIBRATION_SCHEMA",
    "DETECTIONS_SCHEMA",
    "MOUNT_SCHEMA",
    "RecordedImage",
    "camera_of",
    "decoded_ahead",
    "detections",
    "detections_by_frame",
    "frames",
    "picture_topics",
    "shots",
]

CALIBRATION_SCHEMA = "foxglove.CameraCalibration"
MOUNT_SCHEMA = "foxglove.FrameTransform"
_MATRIX = 9
_UNIT = 1e-3
"""How far a quaternion's length may be from one."""
_MOST_PIXELS = 1 << 16
_log = logging.getLogger(__name__)
_PICTURE_SCHEMAS = IMAGE_SCHEMAS | VIDEO_SCHEMAS
DETECTIONS_SCHEMA = "aerodaas.Detections"
"""Schema of the messages that `detections` reads."""
_DEPTH = "/aligned_depth"
"""End of the topic of a frame's depth image, next to the topic of its header."""
_AHEAD = 4
"""Number of images decoded ahead of the reader."""
_STILL = frozenset({"jpeg", "png", "webp"})
"""Formats whose pictures are files as recorded."""
_QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 95]
"""Of the files of all others."""


def camera_of(calibration: Any, mount: Any) -> CameraModel | None:  # noqa: ANN401 - protobuf
    """The camera of a recorded calibration and mount.

    Args:
        calibration: A `foxglove.CameraCalibration`.
        mount: A `foxglove.FrameTransform` of the camera on its body.

    Returns:
        None for what is no camera: figures that are not finite, no pixels, or no rotation.
    """
    matrix = [float(one) for one in calibration.K]
    place = tuple(float(getattr(mount.translation, axis)) for axis in "xyz")
    x, y, z, w = (float(getattr(mount.rotation, axis)) for axis in "xyzw")
    if len(matrix) != _MATRIX or not all(map(math.isfinite, (*matrix, *place, x, y, z, w))):
        return None
    fx, fy, cx, cy = matrix[0], matrix[4], matrix[2], matrix[5]
    pixels = int(calibration.width), int(calibration.height)
    size = math.hypot(x, y, z, w)
    if not (min(fx, fy) > 0.0 and min(pixels) > 0 and max(pixels) <= _MOST_PIXELS):
        return None
    if not abs(size - 1.0) <= _UNIT:
        return None
    ox, oy, oz, ow = OPTICAL
    unit = (x / size, y / size, z / size, w / size)
    roll, pitch, yaw = angles_of_rotation(_matrix(compose(unit, (-ox, -oy, -oz, ow))))
    first, second, third = place
    return CameraModel(*pixels, fx, fy, cx, cy, (first, second, third), pitch, yaw, roll)


def _matrix(rotation: Rotation) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Rotation matrix (3, 3) of a unit quaternion."""
    x, y, z, w = rotation
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class PictureFile(NamedTuple):
    """A picture as a file that other programs open."""

    data: bytes
    format: str
    """`jpeg`, `png` or `webp`."""
    width: int
    """Pixels, as is the height, of the picture as it is shown."""
    height: int


@dataclass
class _Video:
    """Decoder of a video and its frames read since the last key frame."""

    decoder: H264Decoder = field(default_factory=H264Decoder)
    group: list[bytes] = field(default_factory=list)
    size: int = 0
    """Bytes of the frames since the last key frame."""

    def add(self, value: Any) -> _VideoFrame:  # noqa: ANN401 - by the schema
        data = picture_bytes(value)
        if is_key_frame(data):
            self.group, self.size = [], 0
        self.size += len(data)
        if self.size > MAX_VIDEO_GROUP:
            # It cannot be decoded, nor can those after it until the next key frame.
            return _VideoFrame(self.decoder, self.group, -1)
        self.group.append(data)
        return _VideoFrame(self.decoder, self.group, len(self.group) - 1)


@dataclass(frozen=True, slots=True)
class _VideoFrame:
    """A frame of a video, with its decoder and the frames that it depends on."""

    decoder: H264Decoder
    group: list[bytes]
    place: int

    def image(self) -> NDArray[np.uint8] | None:
        return None if self.place < 0 else self.decoder.decode(self.group, self.place)


@dataclass(frozen=True, slots=True)
class RecordedImage:
    """An image of a recording, not decoded yet."""

    header: Header
    odometry: Odometry | None
    """Odometry of the vehicle at capture; None if not recorded."""
    record: Record
    video: _VideoFrame | None = None
    size: tuple[int, int] | None = None
    """Width and height in pixels; None if not recorded."""
    decoded: Callable[[], NDArray[np.uint8] | None] | None = None
    """Returns the image if it is being decoded ahead."""
    measured: Record | None = None
    """Record of the depth image; None if the camera measures no depth."""

    @property
    def format(self) -> str:
        """Encoding of the image, such as `jpeg`; empty for raw pixels."""
        return str(picture_field(self.record.value, "format", ""))

    def image(self) -> NDArray[np.uint8] | None:
        """Decode the image.

        Returns:
            Height x width x 3 of BGR; None if it is broken.

        Raises:
            SourceError: If the format is unknown.
        """
        if self.decoded is not None:
            return self.decoded()
        if self.video is None:
            return self._of_size(decode_image(self.record.schema, self.record.value))
        if self.format != "h264":
            raise SourceError(
                f"videos in {self.format!r} cannot be decoded; record them in h264, or as images"
            )
        image = self.video.image()
        if image is None or self.size is None:
            return image
        width, height = self.size
        return self._of_size(image[:height, :width])

    def file(self) -> PictureFile | None:
        """The picture as a file: as recorded, if it is one, otherwise encoded as JPEG.

        Returns:
            The file; None if the picture is broken or its format unknown.
        """
        try:
            image = self.image()
        except SourceError:
            return None
        if image is None:
            return None
        height, width = image.shape[:2]
        if self.video is None and self.format in _STILL:
            return PictureFile(picture_bytes(self.record.value), self.format, width, height)
        data = cv2.imencode(".jpeg", image, _QUALITY)[1].tobytes()
        return PictureFile(data, "jpeg", width, height)

    def _of_size(self, image: NDArray[np.uint8] | None) -> NDArray[np.uint8] | None:
        """The image, or None if it has not the recorded size."""
        if image is None or (self.size is not None and image.shape[1::-1] != self.size):
            return None
        return image

    def depth(self) -> NDArray[np.uint16] | None:
        """Decode the depth image.

        Returns:
            Height x width of millimetres, as in a `Frame`; None without depth, and for one that
            is broken or not of the image's size.
        """
        found = None if self.measured is None else decode_depth(self.measured.value)
        if found is None or self.size is None or found.shape != self.size[::-1]:
            return None
        return found


def picture_topics(recording: Recording) -> list[str]:
    """Topics of a recording that hold images, sorted; topics of a frame's depth are excluded."""
    known = recording.topics
    found = (name for name, one in known.items() if one.schema in _PICTURE_SCHEMAS)
    return sorted(name for name in found if not _is_depth(name, known))


def shots(
    recording: Recording,
    topics: Collection[str] | None = None,
    since: int | None = None,
    *,
    as_written: bool = False,
) -> Iterator[RecordedImage]:
    """Iterate over images in the order of recording, without decoding them.

    Recordings of other software have no frame numbers; there a header has the message's
    sequence number and frame id.

    Args:
        recording: An open recording.
        topics: Topics to read; None for all that hold images.
        since: Earliest mission time of recording, nanoseconds; None for the beginning. Frames of
            a video can be decoded from its first key frame after that.
        as_written: In the order of the file, as `Recording.records` has it.

    Yields:
        Images with their headers and, if recorded, odometry and depth.
    """
    heads: dict[str, Record] = {}
    videos: dict[str, _Video] = defaultdict(_Video)
    depths: dict[str, Record] = {}
    schemas = ("aerodaas.Frame", *_PICTURE_SCHEMAS)
    wanted = None
    if topics is not None:
        wanted = {name for one in topics for name in (one, *_heads(one), _depth_of(one))}
    for record in recording.records(
        schemas=schemas, topics=wanted, since=since, as_written=as_written
    ):
        if record.schema == "aerodaas.Frame":
            heads[record.topic] = record
            continue
        if _is_depth(record.topic, recording.topics):
            depths[record.topic] = record
            continue
        is_video = record.schema in VIDEO_SCHEMAS
        video = videos[record.topic].add(record.value) if is_video else None
        head = next((heads[name] for name in _heads(record.topic) if name in heads), None)
        if head is None or head.captured != record.captured:
            header = Header(record.sequence, record.captured, _frame_id(record.value))
            yield RecordedImage(header, None, record, video)
        else:
            about: FrameInfo = head.value
            size = about.width, about.height
            depth = depths.get(_depth_of(record.topic))
            if depth is not None and depth.captured != record.captured:
                depth = None
            yield RecordedImage(about.header, about.odometry, record, video, size, measured=depth)


def decoded_ahead(found: Iterator[RecordedImage]) -> Iterator[RecordedImage]:
    """Iterate over `found`, with the next few images being decoded by background threads."""
    first = next(found, None)
    if first is None:
        return
    # The frames of a video depend on each other, still images do not.
    threads = 1 if first.video is not None else 2
    waiting: deque[RecordedImage] = deque()
    pool = ThreadPoolExecutor(threads, "decoder")
    try:
        for shot in chain([first], found):
            waiting.append(replace(shot, decoded=pool.submit(shot.image).result))
            if len(waiting) > _AHEAD:
                yield waiting.popleft()
        yield from waiting
    finally:
        # Without waiting: an iterator that is given up may be collected in any thread, at a
        # moment at which joining another one would wait forever.
        pool.shutdown(wait=False)


def frames(
    recording: Recording,
    topics: Collection[str] | None = None,
    stamps: Collection[int] | None = None,
) -> Iterator[Frame]:
    """Iterate over decoded frames in the order of recording; broken ones are left out.

    Args:
        recording: An open recording.
        topics: Topics to read; None for all that hold images.
        stamps: Mission times of capture to read, nanoseconds; only these images are decoded.
            None for all.

    Yields:
        Frames with, if recorded, odometry and depth.
    """
    for shot in shots(recording, topics):
        if stamps is None or shot.record.captured in stamps:
            try:
                image = shot.image()
            except SourceError as error:
                _log.warning(
                    "%s: skipped a picture on %s: %s", recording.path, shot.record.topic, error
                )
                continue
            if image is not None:
                yield Frame(shot.header, image, odometry=shot.odometry, depth=shot.depth())


def detections(
    recording: Recording,
    topics: Collection[str] | None = None,
    since: int | None = None,
    until: int | None = None,
) -> Iterator[tuple[str, Detections]]:
    """Iterate over topics and detections in the order of recording.

    Args:
        recording: The recording.
        topics: Topics to read; None for all.
        since: As for `Recording.records`.
        until: As for `Recording.records`.
    """
    for record in recording.records(
        schemas=(DETECTIONS_SCHEMA,), topics=topics, since=since, until=until
    ):
        yield record.topic, record.value


def detections_by_frame(recording: Recording) -> dict[tuple[str, int], list[Detection]]:
    """Detections of each frame, by the frame's camera and timestamp.

    A tracker repeats its detector's detections with track ids added; the later message wins.
    """
    found: dict[tuple[str, int], dict[tuple[str, object], Detection]] = defaultdict(dict)
    for _, result in detections(recording):
        at = found[result.header.source, result.header.stamp]
        at.update({(item.label, item.box): item for item in result})
    return {key: list(items.values()) for key, items in found.items()}


def _heads(topic: str) -> tuple[str, str]:
    """Topics that may hold the frame header of an image on `topic`."""
    stream = topic.removesuffix("/image")
    return stream, f"{stream}/frame"


def _depth_of(topic: str) -> str:
    """Topic of the depth that belongs to the images on `topic`."""
    return topic.removesuffix("/image") + _DEPTH


def _is_depth(topic: str, known: Collection[str]) -> bool:
    return topic.endswith(_DEPTH) and any(name in known for name in _heads(topic[: -len(_DEPTH)]))


def _frame_id(value: Any) -> str:  # noqa: ANN401 - by the schema
    head = getattr(value, "header", value)
    found = value.get("frame_id", "") if isinstance(value, dict) else getattr(head, "frame_id", "")
    return str(found)
