"""Sharing of one wire by the vehicles of one process: a radio or a router with many system ids."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from aerodaas.drivers.mavlink.wire.framing import senders
from aerodaas.drivers.mavlink.wire.senders import SenderPins
from aerodaas.drivers.mavlink.wire.transport import Transport
from aerodaas.drivers.pin import Peer
from aerodaas.drivers.waiting import wait_readable
from aerodaas.errors import VehicleError

__all__ = ["WireMember", "WireShare", "share_wire"]

_TICK = 0.05
"""Longest time between two looks at the wire, seconds: a cut one is opened anew by looking."""
_AT_ONCE = 256
"""Most pieces that a vehicle's link processes in one turn."""
_MOST = 1024
"""Most pieces that wait for a vehicle's link."""
_MOST_OF_OTHERS = 256
"""Most pieces that wait for it when another arrives that is not the vehicle's for sure."""

_lock = threading.Lock()
_wires: dict[str, _SharedWire] = {}
"""Open wires of this process by URL."""


class WireMember(Protocol):
    """A vehicle's link, as those that share its wire know it."""

    pins: SenderPins
    """Senders of its vehicle."""

    @property
    def key(self) -> bytes | None:
        """By which it signs, if it does."""
        ...

    def send(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        """Send a message to its vehicle, at once; in any thread."""
        ...


class WireShare:
    """One vehicle's share of a wire, a `Transport`: what comes for it, and the way to it.

    It has a queue of its own: what another vehicle sends, however much, takes none of its room.
    """

    def __init__(
        self, owner: _SharedWire, name: str, system: int, member: WireMember, *, hears_all: bool
    ) -> None:
        """Share of robot `name`, whose vehicle is `system`.

        With `hears_all` it is given what is of the other vehicles alone, too.
        """
        self.name = name
        self.system = system
        self.member = member
        self.hears_all = hears_all
        self.dropped = 0
        """Pieces for which there was no room."""
        self._owner = owner
        self._lock = threading.Lock()
        self._waiting: deque[tuple[bytes, Peer]] = deque()
        self._rung = False
        self._bell, self._rope = socket.socketpair()

    @property
    def others(self) -> tuple[WireMember, ...]:
        """The other vehicles' links that share the wire."""
        return tuple(one.member for one in self._owner.shares if one is not self)

    def is_foreign(self, system: int) -> bool:
        """Whether `system` is another vehicle that shares the wire."""
        return system != self.system and system in self._owner.systems

    def put(self, content: bytes, peer: Peer, *, own: bool) -> None:
        """Add a datagram, or drop it if too many wait.

        Args:
            content: The datagram.
            peer: Address that it came from.
            own: Whether the vehicle's ids are on it.
        """
        with self._lock:
            if len(self._waiting) >= (_MOST if own else _MOST_OF_OTHERS):
                self.dropped += 1
                return
            self._waiting.append((content, peer))
            if not self._rung:
                self._rung = True
                self._rope.send(b"!")

    def fileno(self) -> int:
        """File descriptor to wait for."""
        return self._bell.fileno()

    def receive(self) -> list[tuple[bytes, Peer]]:
        """Received bytes by sender; never blocks."""
        with self._lock:
            count = min(_AT_ONCE, len(self._waiting))
            arrived = [self._waiting.popleft() for _ in range(count)]
            if self._rung and not self._waiting:
                self._bell.recv(1)
                self._rung = False
        return arrived

    def send(self, packet: bytes, peers: tuple[Peer, ...]) -> None:
        """Send a packet; drops unsendable ones."""
        self._owner.send(packet, peers)

    def close(self) -> None:
        """Give the share back; the last one closes the wire."""
        with _lock:
            self._owner.remove(self)
        with self._lock:
            self._bell.close()
            self._rope.close()


class _SharedWire:
    """A wire and the one thread that reads it."""

    def __init__(self, url: str, wire: Transport) -> None:
        self._url = url
        self._wire = wire
        self._sending = threading.Lock()
        self._closing = False
        self.shares: tuple[WireShare, ...] = ()
        """Replaced, never mutated."""
        self.systems: frozenset[int] = frozenset()
        self._thread = threading.Thread(target=self._run, name=f"{url}-wire", daemon=True)
        self._thread.start()

    def join(self, name: str, system: int, member: WireMember, *, hears_all: bool) -> WireShare:
        """A further share; raises VehicleError if `system` has one already."""
        for one in self.shares:
            if one.system == system:
                raise VehicleError(
                    f"{name}: system {system} on {self._url} is {one.name}'s already, which is "
                    "connected by this process"
                )
        share = WireShare(self, name, system, member, hears_all=hears_all)
        self._use((*self.shares, share))
        return share

    def remove(self, share: WireShare) -> None:
        """Serve `share` no more; close the wire if it was the last."""
        self._use(tuple(one for one in self.shares if one is not share))
        if self.shares or self._closing:
            return
        self._closing = True
        _wires.pop(self._url, None)
        self._thread.join(timeout=2.0)
        self._wire.close()

    def _use(self, shares: tuple[WireShare, ...]) -> None:
        self.shares = shares
        self.systems = frozenset(one.system for one in shares)

    def send(self, packet: bytes, peers: tuple[Peer, ...]) -> None:
        """Send from any thread: packets of two vehicles never mix on a stream of bytes."""
        with self._sending:
            self._wire.send(packet, peers)

    def _run(self) -> None:
        while not self._closing:
            wait_readable([self._wire.fileno()], _TICK)
            for content, peer in self._wire.receive():
                self._distribute(content, peer)

    def _distribute(self, content: bytes, peer: Peer) -> None:
        # A stream of bytes has no limits of packets: each link cuts out its own.
        found = None if peer is None else senders(content)
        systems = None if found is None else {system for system, _ in found}
        known = self.systems
        for share in self.shares:
            own = peer is None or share.system in (systems or ())
            if own or systems is None or systems - known or share.hears_all:
                with contextlib.suppress(OSError):
                    # It may just be closing.
                    share.put(content, peer, own=own)


def share_wire(
    url: str,
    name: str,
    system: int,
    member: WireMember,
    open_transport: Callable[[str, str], Transport],
    *,
    hears_all: bool,
) -> WireShare:
    """Share of the wire at `url`, which the first of this process opens, and the last closes.

    Args:
        url: The wire's address.
        name: The robot's.
        system: Its vehicle's system id.
        member: Its link.
        open_transport: Opens the wire.
        hears_all: Whether it is given the other vehicles' packets, too, to forward them.

    Raises:
        ConfigError: For an invalid address.
        VehicleError: If it cannot be opened, or has a vehicle of this system id already.
    """
    with _lock:
        if url not in _wires:
            _wires[url] = _SharedWire(url, open_transport(url, name))
        return _wires[url].join(name, system, member, hears_all=hears_all)
