"""What a tenant may still use this month."""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.service.store import Store

__all__ = ["Quotas", "QuotasLeft"]


@dataclass(frozen=True, slots=True)
class QuotasLeft:
    """What a tenant may still use in a month; infinity where it has no quota."""

    flight_minutes: float
    tasks: float
    cloud_calls: float
    storage_bytes: float


class Quotas:
    """Compares what tenants have used with what they may use in a calendar month (UTC)."""

    def __init__(self, store: Store) -> None:
        """Quotas and usage are those in `store`."""
        raise NotImplementedError

    def left(self, tenant: str, now: float, committed: float = 0.0) -> QuotasLeft:
        """What `tenant` may still use; below zero where it has used more than its quota.

        Args:
            tenant: Name of the tenant; an unknown one has no quotas.
            now: Moment, seconds of Unix time.
            committed: Minutes that it holds or waits for already, as `LeaseBook.committed` tells.

        Raises:
            StoreError: If the database does not answer.
        """
        raise NotImplementedError

    def check(self, tenant: str, minutes: float, now: float, committed: float = 0.0) -> QuotasLeft:
        """Check that a tenant may have another `minutes`, times robots, of flight.

        Raises:
            RefusedError: With status 403, naming the quota that is used up.
            StoreError: If the database does not answer.
        """
        raise NotImplementedError
