"""Selection of a flight's key moments and their images."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.recording.pictures import detections_by_frame, frames
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedDetection, RecordedFlight
from aerodaas.recording.report.overlay import draw_detections

__all__ = ["Moment", "MomentPicture", "key_moments", "picture_moments"]

_MOST = 12
_WIDEST = 1920
"""Pixels along a side of a moment's picture, more than the page shows."""


@dataclass(frozen=True, slots=True)
class Moment:
    """A frame selected for the report, and the reason."""

    stamp: int
    """Mission nanoseconds of the frame."""
    source: str
    """Its camera."""
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class MomentPicture:
    """A moment with its image, detections drawn."""

    moment: Moment
    image: NDArray[np.uint8]

    @property
    def caption(self) -> str:
        """Mission time and reason."""
        return f"{seconds(self.moment.stamp):.1f} s: {self.moment.reason}"


def key_moments(flight: RecordedFlight, most: int = _MOST) -> list[Moment]:
    """Choose the key moments of a flight.

    The first and the most confident detections have priority, then alerts, then changes of the
    mission state; remaining frames are spread evenly over the flight.

    Args:
        flight: The flight.
        most: Most frames to choose; default 12.

    Returns:
        The moments, in order of time.
    """
    chosen: dict[tuple[str, int], Moment] = {}
    for stamp, source, reason in _candidates(flight, most):
        stamps = flight.frame_stamps.get(source, [])
        place = min(bisect_left(stamps, stamp), len(stamps) - 1)
        if place < 0 or len(chosen) >= most:
            continue
        moment = Moment(stamps[place], source, reason)
        chosen.setdefault((source, moment.stamp), moment)
    return sorted(chosen.values(), key=lambda moment: (moment.stamp, moment.source))


def picture_moments(recording: Recording, moments: list[Moment]) -> list[MomentPicture]:
    """Read the frames of key moments and draw their detections.

    Args:
        recording: The open recording.
        moments: Moments of this recording, as from `key_moments`.

    Returns:
        The images, in the order of recording; moments without an image are left out.
    """
    wanted = {(moment.source, moment.stamp): moment for moment in moments}
    stamps = {moment.stamp for moment in moments}
    found = detections_by_frame(recording)
    pictures = []
    for frame in frames(recording, stamps=stamps):
        key = (frame.header.source, frame.header.stamp)
        if key in wanted:
            image = frame.image.copy()
            draw_detections(image, found.get(key, ()))
            # Taken out, so that repeated frames cost one picture.
            pictures.append(MomentPicture(wanted.pop(key), _shrunk(image)))
    return pictures


def _shrunk(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The image at no more than `_WIDEST` pixels along a side: a dozen are kept at once."""
    scale = _WIDEST / max(image.shape)
    if scale >= 1:
        return image
    size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _candidates(flight: RecordedFlight, most: int) -> Iterator[tuple[int, str, str]]:
    """Yield timestamp, camera and reason, by descending priority."""
    yield from _sightings(flight, max(1, most // 4))
    yield from _alerts(flight)
    yield from _states(flight)
    for camera, stamps in flight.frame_stamps.items():
        for place in np.linspace(0, len(stamps) - 1, most).astype(int):
            yield stamps[place], camera, camera


def _sightings(flight: RecordedFlight, labels: int) -> Iterator[tuple[int, str, str]]:
    """Yield the first and the most confident detection of each of the first few labels."""
    first: dict[str, RecordedDetection] = {}
    best: dict[str, RecordedDetection] = {}
    for sighting in flight.sightings:
        first.setdefault(sighting.label, sighting)
        if sighting.score > best.setdefault(sighting.label, sighting).score:
            best[sighting.label] = sighting
    for reason, found in (("first", first), ("surest", best)):
        for label, sighting in list(found.items())[:labels]:
            yield sighting.stamp, sighting.source, f"{reason} {label}"


def _alerts(flight: RecordedFlight) -> Iterator[tuple[int, str, str]]:
    """Yield the first alert of each kind, with the first camera."""
    told: set[str] = set()
    for time, kind, text in flight.alerts:
        if kind not in told and flight.frame_stamps:
            told.add(kind)
            yield round(time * NANOSECONDS), next(iter(flight.frame_stamps)), f"alert: {text}"


def _states(flight: RecordedFlight) -> Iterator[tuple[int, str, str]]:
    """Yield each robot's changes of mission state; those to new states before repeated ones."""
    for name, robot in flight.robots.items():
        met: set[str] = set()
        again = []
        for camera in [one for one in flight.frame_stamps if one.startswith(f"{name}/")][:1]:
            for band in robot.bands:
                state = band.state.replace("_", " ")
                text = f"{state}: {band.reason}" if band.reason else state
                moment = (round(band.start * NANOSECONDS), camera, text)
                if band.state in met:
                    again.append(moment)
                else:
                    met.add(band.state)
                    yield moment
        yield from again
