"""Hub of live streams: each is read and packed once, whatever the number of its watchers."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

from aerodaas.types.errors import AeroDaaSError

__all__ = ["StreamHub", "Watcher"]

Packed: TypeAlias = tuple[dict[str, Any], bytes]
_WAITING = 8
"""Most items that wait for one watcher; older ones are left out, for they are stale."""


class Watcher:
    """One watcher's queue, filled by a thread and read by the event loop."""

    def __init__(self) -> None:
        """Belong to the running event loop."""
        self._loop = asyncio.get_running_loop()
        self._queue: asyncio.Queue[Packed | None] = asyncio.Queue()
        self.left_out = 0
        """Items that newer ones took the place of."""

    def put(self, packed: Packed | None) -> None:
        """Add an item, in any thread; None for the stream's end."""
        with contextlib.suppress(RuntimeError):  # the loop has been closed
            self._loop.call_soon_threadsafe(self._put, packed)

    def _put(self, packed: Packed | None) -> None:
        if self._queue.qsize() >= _WAITING:
            self._queue.get_nowait()
            self.left_out += 1
        self._queue.put_nowait(packed)

    async def next(self) -> Packed | None:
        """The next item; None once the stream has ended."""
        return await self._queue.get()


class _Source:
    """One stream with its watchers."""

    def __init__(self) -> None:
        self.watchers: set[Watcher] = set()


class StreamHub:
    """Streams of all missions that are being watched."""

    def __init__(self, items: Callable[[str, str], Iterator[Packed]]) -> None:
        """Read streams by `items(mission, stream)`."""
        self._items = items
        self._lock = threading.Lock()
        self._sources: dict[tuple[str, str], _Source] = {}

    def watch(self, mission: str, stream: str) -> Watcher:
        """Begin to watch a stream; `leave` ends it."""
        watcher, key = Watcher(), (mission, stream)
        with self._lock:
            source = self._sources.get(key)
            if source is None:
                source = self._sources[key] = _Source()
                arguments = (key, source)
                threading.Thread(target=self._read, args=arguments, daemon=True).start()
            source.watchers.add(watcher)
        return watcher

    def leave(self, mission: str, stream: str, watcher: Watcher) -> None:
        """End watching; the stream is read until its last watcher has left."""
        with self._lock:
            source = self._sources.get((mission, stream))
            if source is not None:
                source.watchers.discard(watcher)

    def _read(self, key: tuple[str, str], source: _Source) -> None:
        try:
            with contextlib.suppress(AeroDaaSError):
                for message, blob in self._items(*key):
                    with self._lock:
                        watchers = list(source.watchers)
                        if not watchers:
                            return
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
