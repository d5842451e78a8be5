"""The book of leases: rules of who flies which drone until when."""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable
from typing import Protocol

from aerodaas.service.leases.candidates import Fleet
from aerodaas.service.schemas import LeaseIn, LeaseOut
from aerodaas.service.store import Lease

__all__ = ["LeaseBook", "Shelf", "lease_out"]


class Shelf(Protocol):
    """What the book keeps its leases in: `Store.leases`."""

    def live(self) -> list[Lease]:
        """Those queued or granted, in the queue's order."""
        ...

    def put(self, *rows: Lease) -> None:
        """Keep all of these, or none and raise StoreError."""
        ...

    def highest_number(self) -> int:
        """The highest place in the queue that was ever given."""
        ...


class LeaseBook:
    """Grants, queues and ends leases; every rule goes by an explicit now. Threads may share it.

    - One granted lease holds a robot; a lease of several robots is granted as a whole.
    - Leases are granted in the order in which they were asked for. A later one may be granted
      before an earlier one only if they share no robot that the earlier one waits for.
    - A lease with a robot that is out of service waits, and holds up nobody.
    - A granted lease ends after its minutes at the latest; from then on it holds nothing, even
      before `tick` has told so.

    Each change returns the leases whose state it changed, in order: those that ended first
    (whose flights are to be recalled), then those granted (whose flights may start).

    Ends hold even while the database fails; they are kept there with the next change. Requests,
    grants and extensions are carried out only if the database has taken them.
    """

    def __init__(
        self, shelf: Shelf, new_id: Callable[[], str] = lambda: secrets.token_hex(8)
    ) -> None:
        """Go on with the leases on `shelf`; call `tick` next, for some may be over.

        Raises:
            StoreError: If the database does not answer.
        """
        raise NotImplementedError

    def request(
        self, wish: LeaseIn, tenant: str, account: str, now: float, fleet: Fleet
    ) -> tuple[Lease, tuple[Lease, ...]]:
        """Ask for drones: granted at once if they are free and nobody waits for them, or queued.

        Args:
            wish: What is asked for.
            tenant: Tenant of the account.
            account: Who asks.
            now: Moment, seconds of Unix time.
            fleet: The drones as they are now.

        Returns:
            The new lease, and all leases changed, this one among them if it is granted.

        Raises:
            RefusedError: With status 404 for an unknown robot; 409 for one that is out of
                service, or if no drone of the fleet could ever fit; 422 for a robot named twice;
                429 if the tenant, or all of them, wait for too many.
            StoreError: If the database does not take it; nothing is asked for then.
        """
        raise NotImplementedError

    def extend(
        self, id_: str, minutes: float, now: float, fleet: Fleet, allowed: float = math.inf
    ) -> tuple[Lease, tuple[Lease, ...]]:
        """Let a granted lease end `minutes` later.

        Args:
            id_: The lease.
            minutes: How much later; positive.
            now: Moment, seconds of Unix time.
            fleet: The drones as they are now.
            allowed: Minutes that the tenant's quota leaves, for all robots together.

        Returns:
            The lease with its new end, and the leases changed.

        Raises:
            RefusedError: With status 404 for an unknown lease; 409 if it is not granted or
                another waits for one of its robots; 403 if the quota or a day is exceeded.
            StoreError: If the database does not take it; the lease ends as before.
        """
        raise NotImplementedError

    def give_back(self, id_: str, now: float, fleet: Fleet) -> tuple[Lease, ...]:
        """End a queued or granted lease at its tenant's wish; one that has ended stays so.

        Raises:
            RefusedError: With status 404 for a lease that is unknown or has ended.
        """
        raise NotImplementedError

    def revoke(self, id_: str, reason: str, now: float, fleet: Fleet) -> tuple[Lease, ...]:
        """End a queued or granted lease at an operator's wish, or a policy's, with the reason.

        Raises:
            RefusedError: With status 404 for a lease that is unknown or has ended.
        """
        raise NotImplementedError

    def tick(self, now: float, fleet: Fleet) -> tuple[Lease, ...]:
        """End what is over, and grant what has become free; call it every second or so.

        While the database fails, ends are returned, and grants wait.
        """
        raise NotImplementedError

    def live(self) -> list[Lease]:
        """Those queued or granted, in the queue's order."""
        raise NotImplementedError

    def get(self, id_: str) -> Lease | None:
        """A lease that is queued or granted; None for others, which the store knows."""
        raise NotImplementedError

    def holder(self, robot: str, now: float) -> Lease | None:
        """The granted lease that holds a robot now; None if it is free."""
        raise NotImplementedError

    def committed(self, tenant: str, now: float) -> float:
        """Minutes, times robots, that a tenant's leases hold from now on or wait for."""
        raise NotImplementedError

    @property
    def unsaved(self) -> int:
        """Ended leases that the database has not taken yet."""
        raise NotImplementedError


def lease_out(lease: Lease) -> LeaseOut:
    """A lease as the HTTP interface shows it."""
    raise NotImplementedError
