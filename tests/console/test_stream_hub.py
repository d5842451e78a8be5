"""One reader for all who watch a stream; each gets a video from a key frame on, without a gap."""

from __future__ import annotations

import asyncio
import json
import queue
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aerodaas.analytics.wire_items import pack
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.protocol.schemas import PictureForm
from aerodaas.recording.converters.h264 import H264Encoder
from aerodaas.service.live import packed_reader
from aerodaas.service.live.hub import StreamHub, Watcher
from aerodaas.service.live.packed_reader import PackedReader

GROUP = 30
"""Pictures from one key frame to the next."""
COUNT = 12


class Camera:
    """A stream whose items a test hands out."""

    def __init__(self) -> None:
        self.begun = 0
        self._items: queue.Queue[dict[str, Any] | None] = queue.Queue()

    def items(
        self, mission: str, stream: str, form: PictureForm
    ) -> Iterator[tuple[dict[str, Any], bytes]]:
        """As a flight's."""
        del mission, stream, form
        self.begun += 1
        while (item := self._items.get(timeout=20)) is not None:
            yield item, b"x"

    def end(self) -> None:
        """Have nothing come any more."""
        self._items.put(None)

    def take(self, number: int, *, video: bool = True) -> None:
        """Have a picture come."""
        self._items.put({"n": number} | ({"key": number % GROUP == 0} if video else {}))


async def _numbers(watcher: Watcher, last: int) -> list[int]:
    """The pictures that come, up to this one."""
    found: list[int] = []
    while not found or found[-1] != last:
        item = await asyncio.wait_for(watcher.next(), 20)
        assert item is not None
        found.append(json.loads(item.text)["n"])
    return found


def _run(check: Callable[[StreamHub, Camera], Awaitable[None]]) -> Camera:
    camera = Camera()

    async def checked() -> None:
        await asyncio.wait_for(check(StreamHub(camera.items), camera), 60)

    asyncio.run(checked())
    camera.end()
    return camera


async def _watch(hub: StreamHub) -> Watcher:
    return hub.add_watcher("m", "cam", PictureForm.H264)


@pytest.mark.parametrize("joined", [0, 7, GROUP - 1, GROUP, GROUP + 3])
def test_who_joins_gets_the_video_from_its_last_key_frame(joined: int) -> None:
    """At once, and then each picture; the stream is read once for both."""

    async def check(hub: StreamHub, camera: Camera) -> None:
        first = await _watch(hub)
        for number in range(joined + 1):
            camera.take(number)
            await _numbers(first, number)
        second = await _watch(hub)
        begin = joined - joined % GROUP
        assert await _numbers(second, joined) == list(range(begin, joined + 1))
        for number in range(joined + 1, joined + 5):
            camera.take(number)
        for one in (first, second):
            assert await _numbers(one, joined + 4) == list(range(joined + 1, joined + 5))

    assert _run(check).begun == 1


def test_who_lags_goes_on_at_a_key_frame() -> None:
    """What comes after the first missing picture could not be decoded."""

    async def check(hub: StreamHub, camera: Camera) -> None:
        quick, slow = await _watch(hub), await _watch(hub)
        for number in range(2 * GROUP + 3):
            camera.take(number)
            await _numbers(quick, number)
        found = await _numbers(slow, 2 * GROUP + 2)
        assert found == [2 * GROUP, 2 * GROUP + 1, 2 * GROUP + 2]
        assert slow.left_out == 2 * GROUP

    _run(check)


def test_who_lags_in_single_pictures_gets_the_newest() -> None:
    """Each of them can be shown without the others."""

    async def check(hub: StreamHub, camera: Camera) -> None:
        quick, slow = await _watch(hub), await _watch(hub)
        for number in range(50):
            camera.take(number, video=False)
            await _numbers(quick, number)
        assert await _numbers(slow, 49) == list(range(42, 50))

    _run(check)


def test_a_beginning_that_is_too_long_is_not_kept() -> None:
    """A video without key frames is none that can be joined; who joins waits for one."""

    async def check(hub: StreamHub, camera: Camera) -> None:
        first = await _watch(hub)
        for number in [0, *(GROUP * n + 1 for n in range(200))]:
            camera.take(number)
            await _numbers(first, number)
        second = await _watch(hub)
        camera.take(10**4 * GROUP)
        assert await _numbers(second, 10**4 * GROUP) == [10**4 * GROUP]

    _run(check)


@pytest.mark.parametrize("form", [PictureForm.H264, PictureForm.JPEG])
def test_each_frame_is_encoded_and_written_once_for_all(
    monkeypatch: pytest.MonkeyPatch, form: PictureForm
) -> None:
    """Five watch a camera; what they are sent is one and the same."""
    encoded: list[int] = []

    class Counting(H264Encoder):
        def encode(self, image: NDArray[np.uint8], stamp: int) -> bytes:
            encoded.append(stamp)
            return super().encode(image, stamp)

    def counting(item: object, **words: bool) -> tuple[Any, bytes]:
        if isinstance(item, Frame):
            encoded.append(item.header.stamp)
        return pack(item, **words)

    monkeypatch.setattr(packed_reader, "H264Encoder", Counting)
    monkeypatch.setattr(packed_reader, "pack", counting)
    frames: queue.Queue[Frame] = queue.Queue()

    class Stream:
        def next_message(self, timeout: float) -> Message[Any]:
            """The next frame."""
            item = frames.get(timeout=20 * timeout)
            return Message("cam", item.header.id, 0, item.header, 0, (), item)

    def items(*_: object) -> Iterator[tuple[dict[str, Any], bytes]]:
        reader = PackedReader(Stream(), "cam", form)
        for _number in range(COUNT):
            yield reader.next_packed(1.0) or ({}, b"")

    async def check() -> None:
        hub = StreamHub(items)
        watchers = [hub.add_watcher("m", "cam", form) for _ in range(5)]
        for number in range(COUNT):
            frames.put(Frame(Header(number, number, "cam"), np.zeros((48, 64, 3), np.uint8)))
            first, *others = [await asyncio.wait_for(one.next(), 20) for one in watchers]
            assert first is not None
            assert first.blob
            assert all(one is first for one in others)

    asyncio.run(check())
    assert encoded == list(range(COUNT))


def test_items_that_cannot_be_written_are_told_of_once(caplog: pytest.LogCaptureFixture) -> None:
    """Pages ask for it again and again, and would show nothing without a word."""

    def items(*_: object) -> Iterator[tuple[dict[str, Any], bytes]]:
        for number in range(3):
            yield {"kind": "left_out", "reason": f"Strange {number} does not go"}, b""

    async def look() -> None:
        hub = StreamHub(items)
        for _ in range(3):
            watcher = await _watch(hub)
            while await asyncio.wait_for(watcher.next(), 20) is not None:
                pass

    asyncio.run(look())
    (record,) = caplog.records
    assert record.getMessage() == "m: an item of cam is left out: Strange 0 does not go"
