"""Hub of live streams: each is read, packed and written once, whatever the number of watchers.

A video's pictures, whose messages have `key`, need all those before them back to a key frame. Who
begins to watch gets these at once; who lags is left out until the next key frame.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

from aerodaas.errors import AeroDaaSError
from aerodaas.protocol.schemas import PictureForm

__all__ = ["Item", "StreamHub", "Watcher"]

_log = logging.getLogger(__name__)

Packed: TypeAlias = tuple[dict[str, Any], bytes]
"""A message and its blob, as a stream's reader has them."""
_WAITING = 8
"""Most items that wait for one watcher; older ones are left out, for they are stale."""
_LONGEST_GROUP = 120
"""Most pictures of a video that are kept for who begins to watch: two seconds at 60 Hz."""
_KEY = "key"
"""Of a message of a video: whether decoding can begin with it."""


class Item(NamedTuple):
    """Message to each watcher of a stream."""

    text: str
    """The message as JSON."""
    blob: bytes
    key: bool | None
    """Of a video's picture: whether decoding can begin with it; None for anything else."""


class Watcher:
    """One watcher's queue, of the event loop."""

    def __init__(self) -> None:
        self._queue: asyncio.Queue[Item | None] = asyncio.Queue()
        self._begun = 0
        """Items of the beginning that wait, beside the others."""
        self._broken = False
        """Whether pictures before the next key frame are missing."""
        self.left_out = 0
        """Items that newer ones took the place of."""

    def start(self, group: Sequence[Item]) -> None:
        """Add what comes before the next item."""
        for item in group:
            self._begun += 1
            self._queue.put_nowait(item)

    def put(self, item: Item | None) -> None:
        """Add an item; None for the stream's end."""
        full = self._queue.qsize() >= _WAITING + self._begun
        key = None if item is None else item.key
        if key is False and (full or self._broken):
            self._broken = True
            self.left_out += 1
            return
        if key:
            self._broken = False
        if full and item is not None:
            self._leave_out(self._queue.qsize() if key else 1)
        self._queue.put_nowait(item)

    def _leave_out(self, count: int) -> None:
        for _ in range(count):
            self._queue.get_nowait()
        self._begun = max(0, self._begun - count)
        self.left_out += count

    async def next(self) -> Item | None:
        """The next item; None once the stream has ended."""
        item = await self._queue.get()
        self._begun = max(0, self._begun - 1)
        return item


class _Source:
    """One stream with its watchers."""

    def __init__(self) -> None:
        self.watchers: set[Watcher] = set()
        self.loop = asyncio.get_running_loop()
        self.group: list[Item] = []
        """Pictures of a video since its last key frame; empty where these are too many."""

    def keep(self, item: Item) -> None:
        """Keep a picture for who begins to watch."""
        if item.key:
            self.group = [item]
        elif item.key is False and self.group:
            self.group = [*self.group, item] if len(self.group) < _LONGEST_GROUP else []

    def send(self, watchers: Sequence[Watcher], item: Item | None) -> None:
        """Give watchers an item, in any thread: the loop is woken once for all of them."""
        with contextlib.suppress(RuntimeError):  # the loop has been closed
            self.loop.call_soon_threadsafe(_put_all, watchers, item)


def _put_all(watchers: Sequence[Watcher], item: Item | None) -> None:
    for one in watchers:
        one.put(item)


class StreamHub:
    """Streams of all missions that are being watched."""

    def __init__(self, items: Callable[[str, str, PictureForm], Iterator[Packed]]) -> None:
        """Read streams by `items(mission, stream, form)`."""
        self._items = items
        self._lock = threading.Lock()
        self._sources: dict[tuple[str, str, PictureForm], _Source] = {}
        self._told: set[tuple[str, str]] = set()
        """Missions' streams of which it was told that items are left out."""

    def add_watcher(self, mission: str, stream: str, form: PictureForm) -> Watcher:
        """Begin to watch a stream, its pictures in a form; `remove_watcher` ends it.

        All watchers are of one event loop, in which this is called.

        Args:
            mission: Id of the mission.
            stream: Name of the stream.
            form: Form of its pictures.
        """
        watcher, key = Watcher(), (mission, stream, form)
        with self._lock:
            source = self._sources.get(key)
            if source is None:
                source = self._sources[key] = _Source()
                arguments = (key, source)
                threading.Thread(target=self._read, args=arguments, daemon=True).start()
            watcher.start(source.group)
            source.watchers.add(watcher)
        return watcher

    def remove_watcher(
        self, mission: str, stream: str, form: PictureForm, watcher: Watcher
    ) -> None:
        """End watching; the stream is read until its last watcher has left.

        Args:
            mission: Id of the mission.
            stream: Name of the stream.
            form: Form of its pictures.
            watcher: Who leaves.
        """
        with self._lock:
            source = self._sources.get((mission, stream, form))
            if source is not None:
                source.watchers.discard(watcher)

    def _read(self, key: tuple[str, str, PictureForm], source: _Source) -> None:
        try:
            for message, blob in self._items(*key):
                self._tell_left_out(key[:2], message)
                item = Item(json.dumps(message), blob, message.get(_KEY)) if message else None
                with self._lock:
                    watchers = list(source.watchers)
                    if not watchers:
                        return
                    if item is not None:
                        source.keep(item)
                        source.send(watchers, item)
        except AeroDaaSError:
            pass  # The flight is over, or has no such stream.
        finally:
            with self._lock:
                if self._sources.get(key) is source:
                    del self._sources[key]
                source.send(list(source.watchers), None)

    def _tell_left_out(self, stream: tuple[str, str], message: dict[str, Any]) -> None:
        if message.get("kind") == "left_out" and stream not in self._told:
            self._told.add(stream)
            _log.warning("%s: an item of %s is left out: %s", *stream, message.get("reason"))
