"""Pictures of a recording by time of capture, and what was found in them."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from aerodaas.analytics.wire_items import pack
from aerodaas.cameras.images import VIDEO_SCHEMAS, picture_bytes
from aerodaas.cameras.picture_size import picture_fits, picture_format, picture_size
from aerodaas.errors import SourceError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.serialization.schema import MessageError
from aerodaas.recording.converters.h264 import is_key_frame
from aerodaas.recording.messages import NavigationRecord
from aerodaas.recording.pictures import RecordedImage, camera_of, detections, shots
from aerodaas.recording.playback.page_items import (
    packed_depth,
    packed_picture,
    packed_places,
    packed_target,
)
from aerodaas.recording.reader import Recording

__all__ = ["NAVIGATION_SCHEMA", "Captures", "FrameIndex", "Packed"]

NAVIGATION_SCHEMA = "aerodaas.Navigation"
Packed = tuple[dict[str, Any], bytes]
"""An item as a live view sends it: a message, and a picture's bytes."""
_AHEAD = 64
"""Pictures that are passed over rather than sought."""
_BROKEN = 8
"""Broken pictures in a row before which one is looked for that is not."""
_FIRST_LOOK = 64
_FARTHEST_LOOK = 4096
"""Frames of a video before one, among which its key frame is looked for."""


class Captures:
    """When the messages of one topic were captured and recorded, mission nanoseconds."""

    def __init__(self) -> None:
        self.captured = array("q")
        self.recorded = array("q")

    def add(self, captured: int, recorded: int) -> None:
        """Add a message, in the order of recording.

        Args:
            captured: Mission time of capture, nanoseconds.
            recorded: Mission time of recording, nanoseconds.
        """
        self.captured.append(captured)
        self.recorded.append(recorded)

    def sort(self) -> None:
        """Put them in the order of capture, which the two functions below need."""
        order = sorted(range(len(self.captured)), key=self.captured.__getitem__)
        self.captured = array("q", (self.captured[place] for place in order))
        self.recorded = array("q", (self.recorded[place] for place in order))

    def last(self, time: int) -> int:
        """Place of the last one captured at or before `time`; -1 for none."""
        return bisect_right(self.captured, time) - 1

    def at(self, time: int) -> range:
        """Places of those captured at exactly `time`."""
        return range(bisect_left(self.captured, time), bisect_right(self.captured, time))


@dataclass
class _TopicReader:
    """A topic's pictures, being read from some place on."""

    shots: Iterator[RecordedImage]
    place: int
    """Place of the picture that was read last."""
    shot: RecordedImage | None = None


class FrameIndex:
    """Pictures of a recording by time; for one thread at a time."""

    def __init__(
        self,
        recording: Recording,
        pictures: Mapping[str, tuple[str, Captures]],
        found: Mapping[str, tuple[str, Captures]],
        navigation: Mapping[str, tuple[str, Captures]],
        mounts: Mapping[str, tuple[str, str, Captures]],
    ) -> None:
        """Show an open recording.

        Args:
            recording: The recording, which stays open.
            pictures: Topic and captures of each stream of pictures.
            found: The same of detections.
            navigation: The same of navigation.
            mounts: Of a stream of pictures, the topic of its camera's calibration, and topic and
                captures of the mount; each is recorded anew, with the other one, when it changes.
        """
        self._recording = recording
        self._pictures = pictures
        self._found = found
        self._navigation = navigation
        self._mounts = mounts
        self._schemas = {name: one.schema for name, one in recording.topics.items()}
        self._readers: dict[str, _TopicReader] = {}

    def at(self, stream: str, time: int, *, depth: bool = False) -> list[Packed]:
        """The picture of a stream that was the last one captured at or before a time.

        Args:
            stream: Its name; KeyError for an unknown one.
            time: Mission nanoseconds.
            depth: Whether the depth measured with it is wanted, too.

        Returns:
            What was found in the picture, by each analysis, then what was followed in it, then its
            depth if wanted and there, then the picture itself; nothing before the first one. In
            place of a broken picture comes the last whole one before it.
        """
        topic, captures = self._pictures[stream]
        last = captures.last(time)
        for place in range(last, max(-1, last - _BROKEN), -1):
            shot = self._shot(topic, captures, place)
            packed = None if shot is None else _packed(stream, shot)
            if shot is not None and packed is not None:
                measured = list(_measured(stream, shot)) if depth else []
                known = [*self._detections(stream, shot), *self._targets(shot.header)]
                return [*known, *measured, packed]
        return []

    def _shot(self, topic: str, captures: Captures, place: int) -> RecordedImage | None:
        reader = self._readers.get(topic)
        if reader is not None and reader.place == place:
            return reader.shot
        if reader is None or not self._comes(captures, reader.place, place):
            since = self._start(topic, captures, place)
            reader = self._readers[topic] = _TopicReader(
                shots(self._recording, [topic], since), place
            )
        captured, recorded = captures.captured[place], captures.recorded[place]
        for shot in reader.shots:
            if shot.record.captured == captured and shot.record.stamp == recorded:
                reader.place, reader.shot = place, shot
                return shot
            if shot.record.stamp > recorded:
                break
        # It is broken, and what comes after it has been read.
        del self._readers[topic]
        return None

    @staticmethod
    def _comes(captures: Captures, now: int, place: int) -> bool:
        """Whether the picture at `place` comes soon after the one at `now`."""
        later = captures.recorded[place] >= captures.recorded[now]
        return now < place <= now + _AHEAD and later

    def _start(self, topic: str, captures: Captures, place: int) -> int:
        """Where to begin to read so that the picture at `place` can be decoded."""
        if self._schemas[topic] not in VIDEO_SCHEMAS:
            return captures.recorded[place]
        look = _FIRST_LOOK
        while True:
            first = captures.recorded[max(0, place - look)]
            key = None
            records = self._recording.records(
                topics=[topic], since=first, until=captures.recorded[place]
            )
            for record in records:
                if is_key_frame(picture_bytes(record.value)):
                    key = record.stamp
                if record.captured == captures.captured[place]:
                    # What comes next may have been recorded at the same time.
                    break
            if key is not None or look >= min(place, _FARTHEST_LOOK):
                return first if key is None else key
            look *= 4

    def _detections(self, camera: str, shot: RecordedImage) -> Iterator[Packed]:
        header = shot.header
        for stream, (topic, captures) in self._found.items():
            times = {captures.recorded[place] for place in captures.at(header.stamp)}
            for time in sorted(times):
                for _, found in detections(self._recording, [topic], time, time):
                    if (found.header.stamp, found.header.source) == (header.stamp, header.source):
                        message = _message(stream, header.stamp, header.stamp)
                        model = self._camera(camera, header.stamp)
                        posed = replace(found, camera=model, odometry=shot.odometry)
                        item = {"item": pack(found)[0], "blob": False, **packed_places(posed)}
                        yield {**message, **item}, b""

    def _camera(self, stream: str, stamp: int) -> CameraModel | None:
        """The camera as it was when a picture was captured; None where that was not recorded."""
        calibration, mount, captures = self._mounts.get(stream, ("", "", Captures()))
        place = captures.last(stamp)
        if place < 0:
            return None
        time, found = captures.recorded[place], {}
        for record in self._recording.records(topics=[calibration, mount], since=time, until=time):
            if record.captured == captures.captured[place]:
                found[record.topic] = record.value
        return camera_of(found[calibration], found[mount]) if len(found) > 1 else None

    def _targets(self, header: Header) -> Iterator[Packed]:
        for stream, (topic, captures) in self._navigation.items():
            for time in sorted({captures.recorded[place] for place in captures.at(header.stamp)}):
                for record in self._recording.records(topics=[topic], since=time, until=time):
                    found: NavigationRecord = record.value
                    target = found.commands[0].target if found.commands else None
                    of_frame = found.header[1:] == header[1:]
                    if target is not None and of_frame:
                        message = _message(stream, header.stamp, header.stamp)
                        yield {**message, "item": packed_target(header, target), "blob": False}, b""


def _message(stream: str, stamp: int, captured: int) -> dict[str, Any]:
    return {"kind": "item", "stream": stream, "stamp": stamp, "captured": captured}


def _packed(stream: str, shot: RecordedImage) -> Packed | None:
    """A picture as a live view sends it; None for one that is broken."""
    message = _message(stream, shot.record.stamp, shot.record.captured)
    data = _jpeg(shot)
    if data is not None:
        return {**message, "item": _picture(shot, data), "blob": True}, data
    try:
        image = shot.image()
        if image is None:
            return None
        _, data = pack(Frame(shot.header, image))
    except (SourceError, MessageError):
        return None
    return {**message, "item": _picture(shot, data), "blob": True}, data


def _picture(shot: RecordedImage, data: bytes) -> dict[str, Any]:
    return packed_picture(shot.header, len(data), "jpeg", measured=shot.measured is not None)


def _measured(stream: str, shot: RecordedImage) -> Iterator[Packed]:
    """The depth of a picture, if there is any that is whole."""
    depth = shot.depth()
    if depth is not None:
        item, data = packed_depth(shot.header, depth)
        message = _message(stream, shot.record.stamp, shot.record.captured)
        yield {**message, "item": item, "blob": True}, data


def _jpeg(shot: RecordedImage) -> bytes | None:
    """The recorded bytes of a picture that a browser can show as they are."""
    if shot.video is not None or shot.format not in {"jpeg", "jpg"}:
        return None
    data = picture_bytes(shot.record.value)
    size = picture_size(data)
    fits = size is not None and picture_fits(*size) and shot.size in {None, size}
    return data if fits and picture_format(data) == "jpeg" else None
