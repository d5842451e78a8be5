"""From a token to who sends the request."""

from __future__ import annotations

import time
from collections.abc import Callable

from aerodaas.service.access.audit import Audit
from aerodaas.service.access.principal import Principal
from aerodaas.service.store import Store

__all__ = ["Access"]


class Access:
    """Tells who sends a request by its token; wrong tokens are counted, slowed and audited."""

    def __init__(
        self,
        store: Store,
        audit: Audit,
        tell: Callable[[str], None] = lambda _: None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        """Look tokens up in `store`; `tell` tells people of many wrong ones; times are Unix time."""
        raise NotImplementedError

    def of(self, token: str, address: str) -> Principal:
        """Who sends a request.

        Args:
            token: What followed `Bearer` in its header; empty for none.
            address: Where it comes from.

        Raises:
            RefusedError: With status 401 for a token that is missing, malformed, unknown, wrong,
                expired or revoked, or whose account is disabled; all with the same text. With
                429 and `retry_after` after many wrong ones from one address or overall.
            StoreError: If the database does not answer.
        """
        raise NotImplementedError
