"""Hub of live streams: each is read and packed once, whatever the number of its watchers.

A video's pictures, whose messages have `key`, need all those before them back to a key frame. Who
begins to watch gets these at once; who lags is left out until the next key frame.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

from aerodaas.protocol.schemas import PictureForm
from aerodaas.types.errors import AeroDaaSError

__all__ = ["StreamHub", "Watcher"]

Packed: TypeAlias = tuple[dict[str, Any], bytes]
_WAITING = 8
"""Most items that wait for one watcher; older ones are left out, for they are stale."""
_LONGEST_GROUP = 120
"""Most pictures of a video that are kept for who begins to watch: two seconds at 60 Hz."""
_KEY = "key"
"""Of a message of a video: whether decoding can begin with it."""


class Watcher:
    """One watcher's queue, filled by a thread and read by the event loop."""

    def __init__(self) -> None:
        """Belong to the running event loop."""
        self._loop = asyncio.get_running_loop()
        self._queue: asyncio.Queue[Packed | None] = asyncio.Queue()
        self._begun = 0
        """Items of the beginning that wait, beside the others."""
        self._broken = False
        """Whether pictures before the next key frame are missing."""
        self.left_out = 0
        """Items that newer ones took the place of."""

    def put(self, packed: Packed | None) -> None:
        """Add an item, in any thread; None for the stream's end."""
        with contextlib.suppress(RuntimeError):  # the loop has been closed
            self._loop.call_soon_threadsafe(self._put, packed)

    def begin(self, group: Sequence[Packed]) -> None:
        """Add what comes before the next item, in any thread."""
        for packed in group:
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._put_first, packed)

    def _put_first(self, packed: Packed) -> None:
        self._begun += 1
        self._queue.put_nowait(packed)

    def _put(self, packed: Packed | None) -> None:
        full = self._queue.qsize() >= _WAITING + self._begun
        key = None if packed is None else packed[0].get(_KEY)
        if key is False and (full or self._broken):
            self._broken = True
            self.left_out += 1
            return
        if key:
            self._broken = False
        if full and packed is not None:
            self._leave_out(self._queue.qsize() if key else 1)
        self._queue.put_nowait(packed)

    def _leave_out(self, count: int) -> None:
        for _ in range(count):
            self._queue.get_nowait()
        self._begun = max(0, self._begun - count)
        self.left_out += count

    async def next(self) -> Packed | None:
        """The next item; None once the stream has ended."""
        packed = await self._queue.get()
        self._begun = max(0, self._begun - 1)
        return packed


class _Source:
    """One stream with its watchers."""

    def __init__(self) -> None:
        self.watchers: set[Watcher] = set()
        self.group: list[Packed] = []
        """Pictures of a video since its last key frame; empty where these are too many."""

    def keep(self, packed: Packed) -> None:
        """Keep a picture for who begins to watch."""
        key = packed[0].get(_KEY)
        if key:
            self.group = [packed]
        elif key is False and self.group:
            self.group = [*self.group, packed] if len(self.group) < _LONGEST_GROUP else []


class StreamHub:
    """Streams of all missions that are being watched."""

    def __init__(self, items: Callable[[str, str, PictureForm], Iterator[Packed]]) -> None:
        """Read streams by `items(mission, stream, form)`."""
        self._items = items
        self._lock = threading.Lock()
        self._sources: dict[tuple[str, str, PictureForm], _Source] = {}

    def watch(self, mission: str, stream: str, form: PictureForm) -> Watcher:
        """Begin to watch a stream, its pictures in a form; `leave` ends it."""
        watcher, key = Watcher(), (mission, stream, form)
        with self._lock:
            source = self._sources.get(key)
            if source is None:
                source = self._sources[key] = _Source()
                arguments = (key, source)
                threading.Thread(target=self._read, args=arguments, daemon=True).start()
            watcher.begin(source.group)
            source.watchers.add(watcher)
        return watcher

    def leave(self, mission: str, stream: str, form: PictureForm, watcher: Watcher) -> None:
        """End watching; the stream is read until its last watcher has left."""
        with self._lock:
            source = self._sources.get((mission, stream, form))
            if source is not None:
                source.watchers.discard(watcher)

    def _read(self, key: tuple[str, str, PictureForm], source: _Source) -> None:
        try:
            with contextlib.suppress(AeroDaaSError):
                for message, blob in self._items(*key):
                    with self._lock:
                        watchers = list(source.watchers)
                        if not watchers:
                            return
                        source.keep((message, blob))
                    if message:
                        for one in watchers:
                            one.put((message, blob))
        finally:
            with self._lock:
                if self._sources.get(key) is source:
                    del self._sources[key]
                left = list(source.watchers)
            for one in left:
                one.put(None)
