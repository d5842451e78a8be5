"""Quotas of tenants, and the rest of them in this month."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime, timezone

from aerodaas.service.errors import RefusedError
from aerodaas.service.store import Store, Tenant

__all__ = ["Quotas", "QuotasLeft"]

_MINUTE = 60.0
"""Seconds."""


@dataclass(frozen=True, slots=True)
class QuotasLeft:
    """Rest of a tenant's quotas in a month; infinity where it has no quota."""

    flight_minutes: float
    cloud_calls: float
    storage_bytes: float


class Quotas:
    """Compares what tenants have used with what they may use in a calendar month (UTC).

    What a mission uses counts in the month in which it started. Keep the usage of a flying
    mission in the store up to date, or several at once may together exceed a quota.
    """

    def __init__(self, store: Store) -> None:
        """Quotas and usage are those in `store`."""
        self._store = store

    def left(self, tenant: str, now: float, committed: float = 0.0) -> QuotasLeft:
        """Rest of the quotas of `tenant`; below zero where it has used more than its quota.

        Args:
            tenant: Name of the tenant; an unknown one has no quotas.
            now: Moment, seconds of Unix time.
            committed: Minutes that it holds or waits for already, as `LeaseBook.committed` tells.

        Raises:
            StoreError: If the database does not answer.
        """
        quotas = self._store.tenants.get(tenant) or Tenant(tenant)
        flown, calls = self._store.usage.total(tenant, _month(now))
        return QuotasLeft(
            flight_minutes=_left(quotas.flight_minutes, flown / _MINUTE + committed),
            cloud_calls=_left(quotas.cloud_calls, calls),
            storage_bytes=_left(quotas.storage_bytes, self._store.usage.stored_bytes(tenant)),
        )

    def check(
        self,
        tenant: str,
        minutes: float,
        now: float,
        committed: float = 0.0,
        *,
        cloud: bool = False,
    ) -> QuotasLeft:
        """Check that a tenant may have further flight.

        Args:
            tenant: Name of the tenant.
            minutes: Minutes, times robots.
            now: Unix time, seconds.
            committed: Minutes, times robots, that its leases hold or wait for.
            cloud: Whether a mission may call the cloud, for which its calls must not be used up;
                one that has begun goes on.

        Returns:
            What is left, without these minutes.

        Raises:
            RefusedError: With status 403, naming the quota that is used up.
            StoreError: If the database does not answer.
        """
        left = self.left(tenant, now, committed)
        if minutes > left.flight_minutes:
            raise RefusedError(
                403,
                f"the quota of {tenant} leaves {max(0.0, left.flight_minutes):.1f} flight minutes "
                f"of this month, and {minutes:.1f} are asked for",
            )
        if left.storage_bytes <= 0:
            raise RefusedError(
                403,
                f"the recordings of {tenant} fill its storage: fetch some, and "
                "delete them here (`aerodaas missions fetch MISSION --delete`)",
            )
        if cloud and left.cloud_calls <= 0:
            raise RefusedError(
                403,
                f"the cloud calls of {tenant} are used up for this month: place all analyses at "
                "the edge",
            )
        return left


def _left(quota: float | None, used: float) -> float:
    return math.inf if quota is None else quota - used


def _month(now: float) -> float:
    """When the calendar month of a moment began."""
    moment = datetime.fromtimestamp(now, timezone.utc)
    return moment.replace(day=1, hour=0, minute=0, second=0, microsecond=0).timestamp()
