"""Senders on the vehicle's wire, each pinned to the address that used its ids first."""

from __future__ import annotations

from collections.abc import Callable

from aerodaas.drivers.mavlink.wire.framing import senders
from aerodaas.drivers.pin import Peer, Pin

__all__ = ["Sender", "SenderPins"]

Sender = tuple[int, int]
"""System and component."""

_MOST = 64
"""Senders remembered at most on one wire."""


class SenderPins:
    """Pins of all senders on the vehicle's wire, each to the address that used its ids first.

    The vehicle's own one is a `Pin`. Others never move: only what is forwarded depends on them.
    """

    def __init__(
        self, may_move: Callable[[], bool], component_ids: frozenset[int] = frozenset()
    ) -> None:
        """Know no sender; `may_move` decides whether the vehicle may change its address.

        `component_ids` are those of the vehicle's own equipment.
        """
        self.target: Sender | None = None
        """The vehicle, once it is adopted."""
        self.pin = Pin("the vehicle", may_move)
        self._component_ids = component_ids
        self._others: dict[Sender, Peer] = {}

    def adopt(self, target: Sender, peer: Peer, now: float) -> None:
        """Pin the vehicle to the address of the HEARTBEAT by which it was found.

        Args:
            target: System and component id.
            peer: The address.
            now: Monotonic clock, seconds.
        """
        self._others.pop(target, None)
        self.pin.set(peer, now)
        self.target = target

    def remember(self, sender: Sender, peer: Peer) -> None:
        """Remember a sender other than the adopted vehicle.

        Args:
            sender: System and component id.
            peer: Address that it speaks from.
        """
        if len(self._others) < _MOST:
            self._others.setdefault(sender, peer)

    def carries(self, sender: Sender, peer: Peer) -> bool:
        """Whether a packet is of the vehicle's own equipment, from the vehicle's address.

        Args:
            sender: System and component id of the packet.
            peer: Address that it came from.
        """
        target = self.target
        known = target is not None and sender[0] == target[0] and sender != target
        return known and sender[1] in self._component_ids and peer == self.pin.address

    @property
    def addresses(self) -> tuple[Peer, ...]:
        """All pinned addresses, each once."""
        own = () if self.target is None else (self.pin.address,)
        return tuple(dict.fromkeys((*own, *self._others.values())))

    def may_pass(self, content: bytes, peer: Peer) -> bool:
        """Whether a datagram may be forwarded: no packet in it uses another address' ids.

        Args:
            content: The datagram.
            peer: Address that it came from; None on a wire without addresses.
        """
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
