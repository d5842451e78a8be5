"""Pictures decoded ahead: one who stops reading waits for nobody, and leaves no thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

from aerodaas.messages.frames import Header
from aerodaas.recording.pictures import RecordedImage, decoded_ahead
from aerodaas.recording.reader import Record


class Stuck:
    """A video whose every picture takes until it is let go."""

    def __init__(self) -> None:
        self.free = threading.Event()

    def image(self) -> None:
        """Wait."""
        self.free.wait(30)


def shots(video: Any, count: int = 50) -> Iterator[RecordedImage]:  # noqa: ANN401 - in the place of a video
    """Pictures of it."""
    for number in range(count):
        value = {"format": "h264", "data": ""}
        record = Record("/cam", "foxglove.CompressedVideo", number, number, number, value)
        yield RecordedImage(Header(number, number, "cam"), None, record, video)


def decoders() -> int:
    """Number of living threads that decode."""
    return sum(thread.name.startswith("decoder") for thread in threading.enumerate())


def test_an_iterator_that_is_given_up_joins_no_thread() -> None:
    """It may be collected in any thread, where waiting for a decoder would be a deadlock."""
    video = Stuck()
    ahead = decoded_ahead(shots(video))
    next(ahead)
    assert decoders() == 1
    begun = time.monotonic()
    del ahead
    assert time.monotonic() - begun < 5
    video.free.set()
    deadline = time.monotonic() + 10
    while decoders() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert decoders() == 0


def test_all_pictures_come_in_order() -> None:
    """Those still being decoded at the end included."""
    video = Stuck()
    video.free.set()
    found = list(decoded_ahead(shots(video)))
    assert [shot.header.id for shot in found] == list(range(50))
    assert [shot.image() for shot in found] == [None] * 50
