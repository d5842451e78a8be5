"""The audit log: who did what to what, and whether it was accepted."""

from __future__ import annotations

import time
from collections.abc import Callable

from aerodaas.protocol.schemas import AuditOut
from aerodaas.service.access.principal import Principal
from aerodaas.service.store import Store

__all__ = ["Audit"]


class Audit:
    """Writes the audit log, whose texts and number of entries are bounded."""

    def __init__(self, store: Store, clock: Callable[[], float] = time.time) -> None:
        """Keep it in `store`; `clock` is Unix time."""
        raise NotImplementedError

    def write(
        self,
        who: Principal | None,
        action: str,
        target: str = "",
        text: str = "",
        *,
        accepted: bool,
        address: str = "",
        required: bool = True,
    ) -> None:
        """Write an entry.

        Args:
            who: Sender of the request; None without a valid token.
            action: `lease.request`, `mission.submit`, …
            target: Id of what it was done to.
            text: Details; cut at 500 characters, control characters replaced.
            accepted: Whether it was carried out.
            address: Where the request came from.
            required: Whether it must not be done unaudited. What makes a drone safe (cancel,
                return home, land) goes on without; such an entry is written with the next one.

        Raises:
            StoreError: If it is required and the database does not take it.
        """
        raise NotImplementedError

    def newest(self, limit: int = 100, tenant: str | None = None) -> list[AuditOut]:
        """The newest entries of a tenant, or of all, newest first; at most 1000."""
        raise NotImplementedError
