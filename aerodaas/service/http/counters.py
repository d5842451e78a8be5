"""Counters of requests by account, and of wrong tokens by address."""

from __future__ import annotations

import ipaddress
import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable

from aerodaas.service.errors import RefusedError
from aerodaas.service.http.limits import RequestLimits

__all__ = ["RateLimiter", "WrongTokens"]


class RateLimiter:
    """A token bucket for each account, of a bounded number; threads may share it.

    A request costs one token; a bucket holds `burst` and fills at `rate` a second. Of too many
    accounts the one that asked least lately is forgotten, which fills its bucket.
    """

    def __init__(self, limits: RequestLimits, clock: Callable[[], float] = time.monotonic) -> None:
        """Admit requests by `limits`; `clock` gives seconds."""
        self._limits = limits
        self._clock = clock
        self._lock = threading.Lock()
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()
        """Tokens, and when they were counted, by account."""

    def admit(self, account: str) -> None:
        """Count a request of an account.

        Raises:
            RefusedError: With status 429 and `retry_after`, if its bucket is empty.
        """
        rate, burst = self._limits.rate, self._limits.burst
        with self._lock:
            now = self._clock()
            level, filled = self._buckets.pop(account, (burst, now))
            level = min(burst, level + rate * max(0.0, now - filled))
            lacking = 1.0 - level
            self._buckets[account] = (level if lacking > 0 else level - 1.0, now)
            if len(self._buckets) > self._limits.rated_accounts:
                self._buckets.popitem(last=False)
        if lacking > 0:
            wait = lacking / rate
            raise RefusedError(
                429, f"too many requests: wait {math.ceil(wait)} s", retry_after=wait
            )


class WrongTokens:
    """Counts wrong tokens; the right one is never refused, for the drone has to obey its operator.

    So a stranger behind the operator's own address cannot lock the operator out. What keeps a
    token from being guessed is its length; the pause keeps guessing from costing the drone's
    computer much, and the alert has people look.
    """

    def __init__(
        self,
        alert: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
        server: str = "remote control",
    ) -> None:
        """Count from now on.

        Args:
            alert: Alerts people, once for each address and period.
            clock: Gives seconds.
            server: Name of what the tokens open, for people.
        """
        self._server = server
        self._alert = alert
        self._clock = clock
        self._peers: OrderedDict[str, tuple[float, int]] = OrderedDict()
        self._overall = (clock(), 0)
        self._silent_until = 0.0

    def count(self, address: str) -> int:
        """Count a wrong token from `address`.

        Returns:
            Seconds that the address has to wait; 0 while there were few.
        """
        limits = RequestLimits
        period, of_all = limits.wrong_token_seconds, limits.wrong_tokens_of_all
        now, peer = self._clock(), _peer(address)
        began, count = _next_count(self._peers.pop(peer, (now, 0)), now)
        self._peers[peer] = (began, count)
        while len(self._peers) > limits.wrong_token_addresses:
            self._peers.popitem(last=False)
        since, overall = self._overall = _next_count(self._overall, now)
        if count == limits.wrong_tokens_alerted and now >= self._silent_until:
            self._alert(f"{self._server}: {count} wrong tokens from {peer}")
        elif overall == of_all and now >= self._silent_until:
            self._silent_until = now + period
            self._alert(f"{self._server}: {overall} wrong tokens from several addresses")
        if count > limits.wrong_tokens:
            return max(1, round(began + period - now))
        return max(1, round(since + period - now)) if overall > of_all else 0


def _next_count(count: tuple[float, int], now: float) -> tuple[float, int]:
    began, number = count
    return (now, 1) if now - began > RequestLimits.wrong_token_seconds else (began, number + 1)


def _peer(address: str) -> str:
    """One name for the addresses that one host may choose from: a /64 of IPv6."""
    try:
        host = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if host.version == 4:  # noqa: PLR2004 - IP's own number
        return str(host)
    return str(ipaddress.ip_network((host, 64), strict=False))
