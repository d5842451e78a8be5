"""Publisher's end of a stream between processes of one node.

Nothing here waits for a reader, and nothing runs between two messages. `send` first looks who has
come, left, or given slots back. Each reader has a queue of its own with its newest `depth`
messages; a message that no longer fits takes the place of the oldest. Readers are woken once all of
them have it.
"""

from __future__ import annotations

import contextlib
import select
import socket
import threading
from collections import deque
from collections.abc import Callable

from aerodaas.actors.streams.codec import Encoded
from aerodaas.actors.streams.completion import Publication
from aerodaas.actors.streams.rendezvous import NewSubscriber, SubscriberListener
from aerodaas.actors.streams.slots import Slot, SlotPool
from aerodaas.actors.streams.wire import (
    IN_SLOT,
    INLINE,
    LEAVING,
    LONGEST,
    LONGEST_INLINE,
    RELEASE,
    SLOT,
    TRAILER,
    packet,
    queue,
    send_descriptors,
    waiting_bytes,
)

__all__ = ["MAX_BORROWED", "MAX_DEPTH", "LocalPublisher"]

MAX_DEPTH = 32
"""Largest queue depth of a reader."""
MAX_BORROWED = 16
"""Most messages in slots that a reader may hold beside those in its queue."""


class _ReaderLink:
    """Connection to one reader."""

    def __init__(self, arrival: NewSubscriber, stream: str, publication: Publication) -> None:
        """Make a queue and send its far end, and where it is told what is complete.

        Raises OSError if the reader is gone or no descriptors are left.
        """
        self.control = arrival.connection
        self.name = arrival.name
        self.held: dict[int, Slot] = {}
        """Slots sent and not given back, by offset."""
        self.leaving = False
        self._depth = max(1, min(arrival.depth, MAX_DEPTH))
        self._knows_pool = False
        self._unread: deque[int] = deque()
        """Sizes of the packets in the queue, oldest first; the reader may have taken some."""
        self._near, self._far = queue()
        try:
            send_descriptors(
                self.control,
                stream,
                self._far.fileno(),
                publication.page.fileno(),
                publication.bell,
            )
        except OSError:
            self._close_queue()
            raise

    def send(self, data: bytes, slot: Slot | None, pool: SlotPool | None) -> list[Slot]:
        """Queue a packet, which refers to `slot` of `pool` if any; returns slots freed by it.

        Raises OSError if the reader is gone.
        """
        freed: list[Slot] = []
        if self.leaving:
            return freed
        self._make_room(freed)
        if slot is not None and pool is not None:
            # A reader copies what exceeds its share, so one that holds more has lost its way.
            if len(self.held) > self._depth + MAX_BORROWED:
                return freed
            if not self._knows_pool:
                send_descriptors(self.control, "", pool.file.fileno())
                self._knows_pool = True
        if self._push(data, freed) and slot is not None:
            slot.users += 1
            self.held[slot.offset] = slot
        return freed

    def release(self, offset: int) -> Slot | None:
        """Take a slot back; returns it if it has no other users, and None if it was not held."""
        slot = self.held.pop(offset, None)
        if slot is None:
            return None
        slot.users -= 1
        return None if slot.users else slot

    def close_queue(self) -> None:
        """Queue nothing more; the reader may still hold slots."""
        self.leaving = True
        self._close_queue()

    def close(self) -> list[Slot]:
        """Close the connection; returns the slots that have no users any more."""
        self.control.close()
        self._close_queue()
        return [slot for offset in list(self.held) if (slot := self.release(offset))]

    def _make_room(self, freed: list[Slot]) -> None:
        """Take back the oldest packets of a full queue, but for its depth.

        So a reader that looks just now finds the newest that is complete; what exceeds its depth it
        drops by itself. To ask the kernel how much has been read takes time, so it is asked when
        the queue may be full, or hold too many slots.
        """
        if len(self._unread) < MAX_DEPTH and len(self.held) < self._depth:
            return
        self._forget_read()
        if len(self._unread) >= MAX_DEPTH or self.held:
            while len(self._unread) > self._depth:
                self._take_back(freed)

    def _push(self, data: bytes, freed: list[Slot]) -> bool:
        """Send a packet, if need be in place of the oldest; returns whether it was sent."""
        while True:
            try:
                self._near.send(data, socket.MSG_NOSIGNAL)
            except BlockingIOError:  # noqa: PERF203 - as many as the kernel takes
                if not self._take_back(freed):
                    return False
            else:
                self._unread.append(len(data))
                return True

    def _close_queue(self) -> None:
        self._near.close()
        self._far.close()

    def _forget_read(self) -> None:
        surplus = sum(self._unread) - waiting_bytes(self._far)
        while surplus > 0:
            surplus -= self._unread.popleft()

    def _take_back(self, freed: list[Slot]) -> bool:
        """Remove the oldest packet from the queue; returns whether there was one."""
        data = packet(self._far, LONGEST)
        self._forget_read()
        if data and data[-1] == IN_SLOT:
            slot = self.release(SLOT.unpack_from(data)[0])
            freed.extend([slot] if slot else [])
        return bool(data)


class LocalPublisher:
    """Publisher of one stream to the readers on its node."""

    def __init__(self, scope: str, stream: str) -> None:
        """Open `stream` of `scope` for writing. Raises AeroDaaSError as `streams_folder` does."""
        self._stream = stream
        self._arrivals = SubscriberListener(scope, stream)
        self._readers: dict[int, _ReaderLink] = {}
        """By the descriptor of their control connections."""
        self._news = select.epoll()
        self._news.register(self._arrivals.bell, select.EPOLLIN)
        self._pool: SlotPool | None = None
        self._publication: Publication | None = None
        self._number = 0
        """Messages queued so far."""
        self._lock = threading.Lock()
        self.refused = 0
        """Number of messages not sent for lack of memory."""

    def send(self, encode: Callable[[], Encoded]) -> None:
        """Send the message that `encode` makes to all readers that have subscribed by now."""
        with self._lock:
            if self._news.closed:
                return
            self._receive_releases()
            if self._arrivals.waiting:
                for arrival in self._arrivals.new():
                    self._admit(arrival)
            if self._readers:
                self._send(encode())

    def close(self) -> None:
        """Close the stream."""
        with self._lock:
            for reader in self._readers.values():
                reader.close()
            self._readers.clear()
            self._arrivals.close()
            self._news.close()
            if self._publication is not None:
                self._publication.close()
                self._publication = None
            if self._pool is not None:
                self._pool.close()
                self._pool = None

    def _send(self, encoded: Encoded) -> None:
        number = self._number + 1
        if encoded.size <= LONGEST_INLINE:
            self._queue(encoded.to_bytes(TRAILER.pack(number, INLINE)), None)
            return
        try:
            self._pool = self._pool or SlotPool()
            slot = self._pool.acquire(encoded.size)
        except OSError:
            slot = None
        if slot is None:
            self.refused += 1
            return
        encoded.write_into(slot.memory)
        slot.users = 1  # ourselves: a reader that ends must not free it for the next message
        where = SLOT.pack(slot.offset, len(slot.memory), encoded.size)
        self._queue(where + TRAILER.pack(number, IN_SLOT), slot)
        slot.users -= 1
        if not slot.users:
            self._put_back([slot])

    def _queue(self, data: bytes, slot: Slot | None) -> None:
        """Queue the next message to all readers, then wake all of them."""
        for reader in list(self._readers.values()):
            try:
                self._put_back(reader.send(data, slot, self._pool))
            except OSError:  # noqa: PERF203 - one reader's end is no other's
                self._dismiss(reader)
        self._number += 1
        if self._publication is not None:
            self._publication.complete(self._number)

    def _admit(self, arrival: NewSubscriber) -> None:
        try:
            self._publication = self._publication or Publication()
            reader = _ReaderLink(arrival, self._stream, self._publication)
        except OSError:
            arrival.connection.close()
            self._arrivals.gone(arrival.name)
            return
        self._readers[reader.control.fileno()] = reader
        self._news.register(reader.control, select.EPOLLIN)

    def _receive_releases(self) -> None:
        """Receive which readers have gone, and which slots are given back."""
        while news := self._news.poll(0):
            for descriptor, _ in news:
                reader = self._readers.get(descriptor)
                if reader is None:
                    self._arrivals.rung()
                    continue
                data = packet(reader.control, LONGEST)
                if data is None:
                    continue
                if len(data) != RELEASE.size:  # its end, or nothing that a reader says
                    self._dismiss(reader)
                    continue
                (offset,) = RELEASE.unpack(data)
                if offset == LEAVING:
                    reader.close_queue()
                elif slot := reader.release(offset):
                    self._put_back([slot])

    def _put_back(self, slots: list[Slot]) -> None:
        if self._pool is not None:
            for slot in slots:
                self._pool.put_back(slot)

    def _dismiss(self, reader: _ReaderLink) -> None:
        del self._readers[reader.control.fileno()]
        with contextlib.suppress(OSError):
            self._news.unregister(reader.control)
        self._put_back(reader.close())
        self._arrivals.gone(reader.name)
