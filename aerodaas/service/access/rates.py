"""How often one sender may ask: token buckets."""

from __future__ import annotations

import time
from collections.abc import Callable

__all__ = ["RateLimiter"]


class RateLimiter:
    """A token bucket for each key (a principal, an address), of bounded number.

    A request takes one token; a bucket holds `burst` and fills at `rate` a second.
    """

    def __init__(
        self,
        rate: float,
        burst: float,
        most: int = 10_000,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Admit `rate` requests a second and `burst` at once of each key; remember `most` keys."""
        raise NotImplementedError

    def admit(self, key: str, cost: float = 1.0) -> None:
        """Take `cost` tokens of a key's bucket.

        Raises:
            RefusedError: With status 429 and `retry_after`, if it holds fewer; none is taken then.
        """
        raise NotImplementedError
