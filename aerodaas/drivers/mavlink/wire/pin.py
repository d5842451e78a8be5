"""Pins: the address from which a peer was first heard, which a stranger cannot move."""

from __future__ import annotations

import math
from collections.abc import Callable

from aerodaas.drivers.mavlink.wire.framing import senders
from aerodaas.drivers.mavlink.wire.transport import Peer

__all__ = ["Pin", "Sender", "SenderPins"]

Sender = tuple[int, int]
"""System and component."""

_SILENT = 5.0
"""Seconds of silence after which a peer may be heard from another address."""
_TOLD = 10.0
"""Seconds for which a refused or a new address is reported."""
_MOST = 64
"""Senders remembered at most on one wire."""


class Pin:
    """Address of one peer.

    Another address takes its place only after `_SILENT` seconds of silence, and only while
    `may_move` says so. A wire with a single peer has no addresses and admits everything.
    """

    def __init__(self, what: str, may_move: Callable[[], bool]) -> None:
        """Pin nothing yet; `what` names the peer in reports."""
        self.address: Peer = None
        """The pinned address; None before the first packet."""
        self._what = what
        self._may_move = may_move
        self._heard_at = -math.inf
        self._refused: Peer = None
        self._refused_at = self._moved_at = -math.inf

    def set(self, peer: Peer, now: float) -> None:
        """Pin `peer`, heard at `now` (seconds)."""
        self.address, self._heard_at = peer, now

    def admits(self, peer: Peer, now: float, *, may_lead: bool = True) -> bool:
        """Whether a packet of `peer` is the pinned one's.

        With `may_lead` False this packet does not make another address the pinned one.
        """
        if peer is None or self.address in {None, peer}:
            self.set(peer, now)
            return True
        if may_lead and now - self._heard_at > _SILENT and self._may_move():
            self.set(peer, now)
            self._moved_at = now
            return True
        self._refused, self._refused_at = self._refused or peer, now
        return False

    def reports(self, now: float) -> list[str]:
        """What the operator must know at `now`, one sentence each."""
        said = []
        if now - self._refused_at <= _TOLD and self._refused is not None:
            host, port = self._refused
            said.append(f"link: {host}:{port} sends as {self._what}, and is not heard")
        if now - self._moved_at <= _TOLD and self.address is not None:
            host, port = self.address
            said.append(f"link: {self._what} is heard from {host}:{port} now")
        return said


class SenderPins:
    """Pins of all senders on the vehicle's wire, each to the address that used its ids first.

    The vehicle's own one is a `Pin`. Others never move: only what is forwarded depends on them.
    """

    def __init__(self, may_move: Callable[[], bool]) -> None:
        """Know no sender; `may_move` decides whether the vehicle may change its address."""
        self.target: Sender | None = None
        """The vehicle, once it is adopted."""
        self.pin = Pin("the vehicle", may_move)
        self._others: dict[Sender, Peer] = {}

    def adopt(self, target: Sender, peer: Peer, now: float) -> None:
        """Pin the vehicle to the address of the HEARTBEAT by which it was found."""
        self._others.pop(target, None)
        self.pin.set(peer, now)
        self.target = target

    def meet(self, sender: Sender, peer: Peer) -> None:
        """Remember a sender other than the adopted vehicle."""
        if len(self._others) < _MOST:
            self._others.setdefault(sender, peer)

    @property
    def addresses(self) -> tuple[Peer, ...]:
        """All pinned addresses, each once."""
        own = () if self.target is None else (self.pin.address,)
        return tuple(dict.fromkeys((*own, *self._others.values())))

    def may_pass(self, content: bytes, peer: Peer) -> bool:
        """Whether a datagram may be forwarded: no packet in it uses another address' ids."""
        if peer is None or self.target is None:
            return True
        found = senders(content)
        if found is None:
            return peer in self.addresses
        return all(self._address(sender, peer) == peer for sender in found)

    def _address(self, sender: Sender, otherwise: Peer) -> Peer:
        if sender == self.target:
            return self.pin.address
        return self._others.get(sender, otherwise)
