"""Results in a recording: detections as numbers, and small pictures."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2

from aerodaas.clock import NANOSECONDS
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.errors import ConfigError
from aerodaas.extensions.agents.answers import FoundLabel, Picture
from aerodaas.extensions.agents.text import world
from aerodaas.recording.pictures import frames, shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedDetection, RecordedFlight

__all__ = ["found_labels", "picture", "pictures", "recording_of"]

_LARGEST = 512 << 20
"""Bytes of a recording that is fetched."""
_MOST = 50
"""Labels, and pictures of a list."""
_WIDTH = 480
"""Pixels of a picture."""
_QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 70]


@contextmanager
def recording_of(client: ProviderClient, mission: str) -> Iterator[Recording]:
    """Fetch and open a mission's recording, which is gone afterwards.

    Args:
        client: Client of the service, whose token must have the scope `sense`.
        mission: Id of the mission.

    Raises:
        AeroDaaSError: If the service refuses it, or it is too large.
    """

    def check(done: int, size: int | None) -> None:
        if max(done, size or 0) > _LARGEST:
            raise ConfigError(
                f"the recording is larger than {_LARGEST >> 20} MiB: ask a person to fetch it"
            )

    with tempfile.TemporaryDirectory(prefix="aerodaas-") as folder:
        file = Path(folder) / "flight.mcap"
        client.recording(mission, file, check)
        with Recording.open(file) as recording:
            yield recording


def found_labels(recording: Recording) -> list[FoundLabel]:
    """Detections by label, the most frequent first."""
    flight = RecordedFlight.read(recording)
    by_label: dict[str, list[RecordedDetection]] = {}
    for one in flight.sightings:
        by_label.setdefault(one.label, []).append(one)
    found = sorted(by_label.items(), key=lambda item: -len(item[1]))
    return [
        FoundLabel(
            label=world(label),
            count=len(seen),
            first_s=min(one.stamp for one in seen) / NANOSECONDS,
            last_s=max(one.stamp for one in seen) / NANOSECONDS,
            best_score=round(max(one.score for one in seen), 3),
        )
        for label, seen in found[:_MOST]
    ]


def pictures(recording: Recording) -> list[Picture]:
    """Some pictures of a recording, evenly spread over the flight."""
    known = [(one.header.source, one.header.stamp) for one in shots(recording)]
    chosen = known[:: max(1, -(-len(known) // _MOST))]
    return [
        Picture(id=f"{camera}@{stamp}", camera=camera, time_s=round(stamp / NANOSECONDS, 3))
        for camera, stamp in chosen
    ]


def picture(recording: Recording, id_: str) -> bytes:
    """A picture as a small JPEG.

    Args:
        recording: An open recording.
        id_: Id of `pictures`.

    Raises:
        ConfigError: If there is none.
    """
    camera, _, stamp = id_.rpartition("@")
    wanted = {int(stamp)} if stamp.isdecimal() else set()
    for frame in frames(recording, stamps=wanted):
        if frame.header.source == camera:
            height, width = frame.image.shape[:2]
            size = (min(_WIDTH, width), max(1, round(height * min(_WIDTH, width) / width)))
            small = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA)
            return bytes(cv2.imencode(".jpg", small, _QUALITY)[1])
    raise ConfigError("there is no such picture: the part `pictures` lists their ids")
