"""Wrong tokens: counted by peer and overall, answered with a pause, and told to people once."""

from __future__ import annotations

import ipaddress
import time
from collections import OrderedDict
from collections.abc import Callable

__all__ = ["WrongTokens"]

_FREE = 10
"""Wrong tokens of one peer, in a period, that are answered as such."""
_FREE_OVERALL = 100
_TOLD = 20
"""Wrong tokens of one peer of which people are told."""
_PERIOD = 60.0
"""Seconds after which a count begins anew."""
_MOST_PEERS = 1024


class WrongTokens:
    """Counts wrong tokens; the right one is never refused, for the drone has to obey its operator.

    So a stranger behind the operator's own address cannot lock the operator out. What keeps a
    token from being guessed is its length; the pause keeps guessing from costing the drone's
    computer much, and the alert has people look.
    """

    def __init__(
        self,
        tell: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
        what: str = "remote control",
    ) -> None:
        """Tell people of `what` through `tell`, once for each peer and period."""
        self._what = what
        self._tell = tell
        self._clock = clock
        self._peers: OrderedDict[str, tuple[float, int]] = OrderedDict()
        self._overall = (clock(), 0)
        self._silent_until = 0.0

    def count(self, address: str) -> int:
        """Count a wrong token from `address`.

        Returns:
            Seconds that the peer has to wait; 0 while there were few.
        """
        now, peer = self._clock(), _peer(address)
        began, count = _later(self._peers.pop(peer, (now, 0)), now)
        self._peers[peer] = (began, count)
        while len(self._peers) > _MOST_PEERS:
            self._peers.popitem(last=False)
        since, overall = self._overall = _later(self._overall, now)
        if count == _TOLD and now >= self._silent_until:
            self._tell(f"{self._what}: {count} wrong tokens from {peer}")
        elif overall == _FREE_OVERALL and now >= self._silent_until:
            self._silent_until = now + _PERIOD
            self._tell(f"{self._what}: {overall} wrong tokens from several addresses")
        if count > _FREE:
            return max(1, round(began + _PERIOD - now))
        return max(1, round(since + _PERIOD - now)) if overall > _FREE_OVERALL else 0


def _later(count: tuple[float, int], now: float) -> tuple[float, int]:
    began, number = count
    return (now, 1) if now - began > _PERIOD else (began, number + 1)


def _peer(address: str) -> str:
    """One name for the addresses that one host may choose from: a /64 of IPv6."""
    try:
        host = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if host.version == 4:  # noqa: PLR2004 - IP's own number
        return str(host)
    return str(ipaddress.ip_network((host, 64), strict=False))
