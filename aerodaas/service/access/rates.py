"""How often one sender may ask: token buckets."""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable

from aerodaas.service.errors import RefusedError

__all__ = ["RateLimiter"]


class RateLimiter:
    """A token bucket for each key (a principal, an address), of bounded number.

    A request takes one token; a bucket holds `burst` and fills at `rate` a second. Of too many
    keys the one that asked least lately is forgotten, which fills its bucket. Threads may share it.
    """

    def __init__(
        self,
        rate: float,
        burst: float,
        most: int = 10_000,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Admit `rate` requests a second and `burst` at once of each key; remember `most` keys."""
        self._rate = rate
        self._burst = burst
        self._most = most
        self._clock = clock
        self._lock = threading.Lock()
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def admit(self, key: str, cost: float = 1.0) -> None:
        """Take `cost` tokens of a key's bucket.

        Raises:
            RefusedError: With status 429 and `retry_after`, if it holds fewer; none is taken then.
        """
        with self._lock:
            now = self._clock()
            level, filled = self._buckets.pop(key, (self._burst, now))
            level = min(self._burst, level + self._rate * max(0.0, now - filled))
            lacking = cost - level
            self._buckets[key] = (level if lacking > 0 else level - cost, now)
            if len(self._buckets) > self._most:
                self._buckets.popitem(last=False)
        if lacking > 0:
            wait = lacking / self._rate
            raise RefusedError(
                429, f"too many requests: wait {math.ceil(wait)} s", retry_after=wait
            )
