"""Pin: the address from which a peer was first heard, which a stranger cannot move."""

from __future__ import annotations

import math
from collections.abc import Callable

__all__ = ["Peer", "Pin"]

Peer = tuple[str, int] | None
"""Address of a sender; None for a wire with a single peer."""

_SILENT = 5.0
"""Seconds of silence after which a peer may be heard from another address."""
_TOLD = 10.0
"""Seconds for which a refused or a new address is reported."""


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
        """Pin `peer`.

        Args:
            peer: Address of the pinned one.
            now: When it was heard, monotonic seconds.
        """
        self.address, self._heard_at = peer, now

    def admits(self, peer: Peer, now: float, *, may_lead: bool = True) -> bool:
        """Whether a packet of `peer` is the pinned one's.

        Args:
            peer: Address that it came from.
            now: When it was heard, monotonic seconds.
            may_lead: False for a packet that does not make another address the pinned one.
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
        """Reports for the operator at `now`, one sentence each."""
        said = []
        if now - self._refused_at <= _TOLD and self._refused is not None:
            host, port = self._refused
            said.append(f"link: {host}:{port} sends as {self._what}, and is not heard")
        if now - self._moved_at <= _TOLD and self.address is not None:
            host, port = self.address
            said.append(f"link: {self._what} is heard from {host}:{port} now")
        return said
