"""Converters of frames and detections: images, calibration, mount, boxes and keypoints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from foxglove.messages import (
    CameraCalibration,
    Color,
    CompressedImage,
    CompressedVideo,
    FrameTransform,
    ImageAnnotations,
    Point2,
    PointsAnnotation,
    PointsAnnotationType,
    RawImage,
    TextAnnotation,
)
from numpy.typing import NDArray

from aerodaas.config.model import RecordingConfig
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.recording.converters.base import Session, convert, foxglove_entry, quaternion, vector
from aerodaas.recording.converters.h264 import H264Encoder
from aerodaas.recording.converters.vehicle import body_frame
from aerodaas.recording.encoding import Entry, topic
from aerodaas.recording.messages import FrameInfo, json_entry
from aerodaas.recording.reference_frames import OPTICAL, compose, from_rpy
from aerodaas.recording.report.overlay import VISIBLE, label_colour, rgb

__all__ = ["EncodedFrame"]

_H264_QUALITY = 23
"""x264's constant rate factor: 18 looks like the original, 28 takes half of 23's space."""
_BLACK = Color(r=0.0, g=0.0, b=0.0, a=0.7)


@dataclass(frozen=True, slots=True)
class EncodedFrame:
    """A `Frame` with its picture encoded."""

    header: Header
    data: bytes
    format: str
    """`jpeg`, `png` or `webp`."""
    width: int
    """Pixels across."""
    height: int
    """Pixels down."""
    camera: CameraModel | None = None
    odometry: Odometry | None = None


@convert.register
def _frame(item: Frame, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write an image, its depth, and its camera's calibration when that has changed."""
    header, stream = item.header, message.stream
    yield from _head(item, stream, session)
    if item.depth is not None and session.config.images != "none":
        # Before the image, so that a reader has the whole frame once it has the image.
        yield _depth(item.depth, header, stream, session)
    if session.config.images == "h264":
        yield _video(item, stream, session)
    elif session.config.images != "none":
        kind = session.config.images
        _, data = cv2.imencode(f".{kind}", item.image, _settings(session.config))
        yield _image(data.tobytes(), kind, header, stream, session)


@convert.register
def _encoded_frame(item: EncodedFrame, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write an image as it came, and its camera's calibration when that has changed."""
    yield from _head(item, message.stream, session)
    yield _image(item.data, item.format, item.header, message.stream, session)


@convert.register
def _detections(item: Detections, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write boxes and keypoints as annotations of the image and as exact JSON."""
    header, stream = item.header, message.stream
    annotations = ImageAnnotations(
        # Foxglove pairs annotations with the image of exactly this time.
        timestamp=session.time(header.stamp),
        points=[shape for found in item.items for shape in _shapes(found)],
        texts=[_label(found) for found in item.items],
    )
    yield foxglove_entry(topic(stream, "boxes"), annotations, header.stamp)
    yield json_entry(item, stream, header.stamp)


def _head(item: Frame | EncodedFrame, stream: str, session: Session) -> Iterator[Entry]:
    header = item.header
    if item.camera is not None and session.changed("camera", stream, item.camera):
        yield from _camera(item.camera, header.source, stream, header.stamp, session)
    about = FrameInfo(header, item.width, item.height, item.odometry)
    yield json_entry(about, stream, header.stamp)


def _image(data: bytes, kind: str, header: Header, stream: str, session: Session) -> Entry:
    image = CompressedImage(
        timestamp=session.time(header.stamp), frame_id=header.source, data=data, format=kind
    )
    return foxglove_entry(topic(stream, "image"), image, header.stamp)


def _depth(depth: NDArray[np.uint16], header: Header, stream: str, session: Session) -> Entry:
    height, width = depth.shape
    image = RawImage(
        timestamp=session.time(header.stamp),
        frame_id=header.source,
        width=width,
        height=height,
        encoding="16UC1",
        step=2 * width,
        data=depth.astype("<u2", copy=False).tobytes(),
    )
    return foxglove_entry(topic(stream, "aligned_depth"), image, header.stamp)


def _video(item: Frame, stream: str, session: Session) -> Entry:
    encoder = session.videos.get(stream)
    if encoder is None or encoder.size != (item.width, item.height):
        encoder = H264Encoder(item.width, item.height, _H264_QUALITY)
        session.videos[stream] = encoder
    stamp = item.header.stamp
    video = CompressedVideo(
        timestamp=session.time(stamp),
        frame_id=item.header.source,
        data=encoder.encode(item.image, stamp),
        format="h264",
    )
    return foxglove_entry(topic(stream, "image"), video, stamp)


def _settings(config: RecordingConfig) -> list[int]:
    if config.images == "png":
        # The fastest: higher levels take ten times as long for a tenth of the space.
        return [cv2.IMWRITE_PNG_COMPRESSION, 1]
    return [cv2.IMWRITE_JPEG_QUALITY, config.jpeg_quality]


def _camera(
    camera: CameraModel, source: str, stream: str, stamp: int, session: Session
) -> Iterator[Entry]:
    time = session.time(stamp)
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    calibration = CameraCalibration(
        timestamp=time,
        frame_id=source,
        width=camera.width,
        height=camera.height,
        K=[fx, 0, cx, 0, fy, cy, 0, 0, 1],
        R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
        P=[fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0],
    )
    yield foxglove_entry(topic(stream, "calibration"), calibration, stamp)
    mount = FrameTransform(
        timestamp=time,
        parent_frame_id=body_frame(source),
        child_frame_id=source,
        translation=vector(camera.mount),
        rotation=quaternion(compose(from_rpy(camera.roll, camera.pitch, camera.yaw), OPTICAL)),
    )
    yield foxglove_entry(topic(stream, "mount"), mount, stamp)


def _colour(label: str) -> Color:
    red, green, blue = rgb(label_colour(label))
    return Color(r=red, g=green, b=blue, a=1.0)


def _shapes(found: Detection) -> Iterator[PointsAnnotation]:
    left, top, right, bottom = found.box
    colour = _colour(found.label)
    corners = ((left, top), (right, top), (right, bottom), (left, bottom))
    yield PointsAnnotation(
        type=PointsAnnotationType.LineLoop,
        points=[Point2(x=float(u), y=float(v)) for u, v in corners],
        outline_color=colour,
        thickness=2.0,
    )
    if found.keypoints is not None:
        yield PointsAnnotation(
            type=PointsAnnotationType.Points,
            points=[Point2(x=u, y=v) for u, v, c in found.keypoints.tolist() if c >= VISIBLE],
            outline_color=colour,
            fill_color=colour,
            thickness=5.0,
        )


def _label(found: Detection) -> TextAnnotation:
    track = f" #{found.track_id}" if found.track_id is not None else ""
    left, top, _, _ = found.box
    return TextAnnotation(
        position=Point2(x=float(left), y=float(top)),
        text=f"{found.label}{track} {found.score:.2f}",
        font_size=12.0,
        text_color=_colour(found.label),
        background_color=_BLACK,
    )
