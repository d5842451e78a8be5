"""Subscriber's end of the streams between processes of one node: one wait for all of them."""

from __future__ import annotations

import contextlib
import select
import socket
import time
import weakref
from collections import deque
from io import FileIO

import numpy as np
from numpy.typing import NDArray

from aerodaas.actors.streams.completion import Completion
from aerodaas.actors.streams.local_publisher import MAX_BORROWED, MAX_DEPTH
from aerodaas.actors.streams.rendezvous import Listener
from aerodaas.actors.streams.slots import map_slot
from aerodaas.actors.streams.wire import (
    IN_SLOT,
    LEAVING,
    LONGEST,
    RELEASE,
    SLOT,
    TRAILER,
    packet,
    receive_descriptors,
)

__all__ = ["LocalSubscriber"]

_COPIED_BYTES = 65536
"""Messages up to this size are copied, in microseconds, so that readers need not hold slots."""
_MOST_AT_ONCE = 1024
"""Messages after which a reader that cannot keep up is given what it has."""


_lenders: set[_PublisherLink] = set()
"""Connections of which messages are still held: their end would give back all slots."""


class _PublisherLink:
    """Connection from one publisher."""

    def __init__(
        self, control: socket.socket, stream: str, queue: socket.socket, completion: Completion
    ) -> None:
        """Read `queue` as far as `completion` says; slots are given back on `control`."""
        self.stream = stream
        self.queue = queue
        self.completion = completion
        self.ended = False
        """Whether the publisher is gone: what was complete is read to its end."""
        self._control = control
        self._newest = 0
        """Number up to which all complete messages were taken."""
        self._early = b""
        """Packet that was taken before it was complete, as the ones before it had been dropped."""
        self._pool: FileIO | None = None
        self._slots: dict[int, NDArray[np.uint8]] = {}
        self._loans: dict[int, weakref.ref[NDArray[np.uint8]]] = {}
        """Messages that are still held, by the offset of their slot."""
        self._closed = False

    @property
    def behind(self) -> bool:
        """Whether there may be something to receive."""
        return self.ended or self.completion.number > self._newest

    def receive(self) -> memoryview | None:
        """Return the next complete message, empty at the stream's end; None if there is none.

        The memory of a large one is shared, and given back when nothing refers to it any more. It
        is copied if the reader already holds too many to receive another.
        """
        complete = self.completion.number
        data = self._early or packet(self.queue, LONGEST)
        if data is None:
            self._newest = complete
            return None
        if not data:
            return memoryview(b"")
        end = len(data) - TRAILER.size
        number, where = TRAILER.unpack_from(data, end)
        if number > complete:
            self._early = data
            return memoryview(b"") if self.ended else None
        self._early = b""
        self._newest = number
        return self._from_slot(data) if where == IN_SLOT else memoryview(data)[:end]

    def close(self) -> None:
        """Read no more; what is still held stays as it is."""
        self.queue.close()
        self.completion.close()
        self._closed = True
        if self._pool is not None:
            self._pool.close()
        self._give_back(LEAVING)
        if not self._loans:
            self._control.close()

    def _from_slot(self, data: bytes) -> memoryview:
        offset, capacity, size = SLOT.unpack_from(data)
        block = self._slot(offset, capacity)[:size]
        if size <= _COPIED_BYTES or len(self._loans) >= MAX_BORROWED - 1:
            copy = block.tobytes()
            self._give_back(offset)
            return memoryview(copy)
        # The views that a decoder makes keep `block` alive.
        self._loans[offset] = weakref.ref(block, lambda _: self._returned(offset))
        _lenders.add(self)
        return block.data

    def _slot(self, offset: int, capacity: int) -> NDArray[np.uint8]:
        if self._pool is None:
            sent = receive_descriptors(self._control, 1)
            if sent is None:
                raise ValueError("a slot without a file")
            self._pool = FileIO(sent[1][0])
        slot = self._slots.get(offset)
        if slot is None:
            slot = self._slots[offset] = map_slot(self._pool.fileno(), offset, capacity)
        return slot

    def _returned(self, offset: int) -> None:
        """Called in any thread, when the last view of a message has gone."""
        self._loans.pop(offset, None)
        self._give_back(offset)
        if not self._loans:
            _lenders.discard(self)
            if self._closed:
                self._control.close()

    def _give_back(self, offset: int) -> None:
        with contextlib.suppress(OSError):  # the publisher is gone, and its slots with it
            self._control.send(RELEASE.pack(offset), socket.MSG_NOSIGNAL)


class LocalSubscriber:
    """Subscriber of several streams for one thread; other threads may `wake` it."""

    def __init__(self, scope: str) -> None:
        """Listen for publishers in `scope`, the prefix of the run's stream names on this node."""
        self._listener = Listener(scope)
        self._heard = select.EPOLLIN
        self._depths: dict[str, int] = {}
        self._unnamed: dict[int, socket.socket] = {}
        """Connections of publishers that have yet to name their stream, by descriptor."""
        self._links: dict[int, _PublisherLink] = {}
        """By the descriptor of their queues."""
        self._alarm, self._bell = socket.socketpair(
            socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK
        )
        self._poll = select.epoll()
        for one in (self._listener.socket, self._alarm):
            self._poll.register(one, select.EPOLLIN)

    def subscribe(self, stream: str, depth: int) -> None:
        """Receive what is published on `stream` from now on.

        Args:
            stream: Name of the stream.
            depth: Newest messages received at a time, at most `MAX_DEPTH`.
        """
        self._depths[stream] = min(depth, MAX_DEPTH)
        self._listener.announce(stream, self._depths[stream])

    def receive(self, timeout: float) -> dict[str, deque[memoryview]]:
        """Return encoded messages by stream, in order; wait up to `timeout` seconds for the first.

        Returns early when woken. Whatever was complete before any of them is among them.
        """
        until = time.monotonic() + timeout if timeout > 0 else 0.0
        self._set_events(select.EPOLLIN)
        found: dict[_PublisherLink, deque[memoryview]] = {}
        woken, count = False, 0
        while count < _MOST_AT_ONCE:
            ready = self._ready(0.0 if found or woken else until)
            for descriptor, _ in ready:
                link = self._links.get(descriptor)
                if link is not None:
                    link.ended = True
                elif descriptor == self._alarm.fileno():
                    woken = packet(self._alarm, LONGEST) is not None
                elif descriptor in self._unnamed:
                    self._introduce(self._unnamed.pop(descriptor))
                elif descriptor == self._listener.socket.fileno():
                    self._accept()
            taken = sum(
                self._read_link(link, found) for link in [*self._links.values()] if link.behind
            )
            if not ready and not taken:
                break
            count += taken
        return self._by_stream(found)

    def _by_stream(
        self, found: dict[_PublisherLink, deque[memoryview]]
    ) -> dict[str, deque[memoryview]]:
        """Put all of a publisher that has ended before what its successor has sent."""
        streams: dict[str, deque[memoryview]] = {}
        for link, messages in found.items():
            if link.stream not in streams:
                streams[link.stream] = deque(maxlen=self._depths[link.stream])
            streams[link.stream] += messages
        return streams

    def wake(self) -> None:
        """Make a waiting `receive` return; thread-safe."""
        with contextlib.suppress(OSError):  # full of calls already, or closed
            self._bell.send(b"\0")

    def close(self) -> None:
        """Close all streams."""
        self._listener.close()
        for link in self._links.values():
            link.close()
        for control in self._unnamed.values():
            control.close()
        self._links.clear()
        self._poll.close()
        self._alarm.close()
        self._bell.close()

    def _ready(self, until: float) -> list[tuple[int, int]]:
        """Wait for sockets that can be read, until a moment of the monotonic clock."""
        left = until - time.monotonic() if until else 0.0
        if left <= 0.0:
            return self._poll.poll(0)
        # The system waits for whole milliseconds; a setpoint is due to the microsecond.
        ready = self._poll.poll(int(left * 1000) / 1000)
        if ready:
            return ready
        time.sleep(max(0.0, until - time.monotonic()))
        return self._poll.poll(0)

    def _read_link(
        self, link: _PublisherLink, found: dict[_PublisherLink, deque[memoryview]]
    ) -> int:
        """Read the complete messages of a link; returns how many there are."""
        count = 0
        while link.behind:
            try:
                data = link.receive()
            except (ValueError, OSError):  # no memory or descriptor left
                data = memoryview(b"")
            if data is None:
                break
            if not data:
                self._end(link)
                break
            if link not in found:
                found[link] = deque(maxlen=self._depths[link.stream])
            found[link].append(data)
            count += 1
        return count

    def _end(self, link: _PublisherLink) -> None:
        """Forget a publisher. Its sockets are open elsewhere, too, so they must be taken out."""
        del self._links[link.queue.fileno()]
        self._poll.unregister(link.queue)
        self._poll.unregister(link.completion.bell)
        link.close()

    def _set_events(self, events: int) -> None:
        """Wait for these events of the listening socket."""
        if events != self._heard:
            self._heard = events
            self._poll.modify(self._listener.socket, events)

    def _accept(self) -> None:
        try:
            control = self._listener.accept()
        except BlockingIOError:
            return
        except OSError:  # no descriptor left: try again at the next call
            self._set_events(0)
            return
        if control is not None:
            self._unnamed[control.fileno()] = control
            self._poll.register(control, select.EPOLLIN)

    def _introduce(self, control: socket.socket) -> None:
        self._poll.unregister(control)
        sent = receive_descriptors(control, 3)
        if sent is None:
            control.close()
            return
        stream, (descriptor, page, bell) = sent
        queue = socket.socket(fileno=descriptor)
        self._poll.register(bell, select.EPOLLIN | select.EPOLLET)
        self._poll.register(queue, 0)  # its end alone
        self._links[descriptor] = _PublisherLink(control, stream, queue, Completion(page, bell))
