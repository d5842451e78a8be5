"""Book of leases: requests, the drones that fit them, and the rules by which they are granted."""

from __future__ import annotations

import math
import secrets
import threading
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

from aerodaas.protocol.schemas import LeaseIn, LeaseOut, LeaseState
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.service.store import Lease, LeaseEnd, Leases

__all__ = ["Candidate", "Fleet", "LeaseBook", "lease_out"]


def _check_wish(wish: LeaseIn, fleet: Fleet) -> None:
    """Raise RefusedError for what this fleet cannot fulfil however long one waits."""
    names = wish.robots or []
    if len(set(names)) < len(names):
        raise RefusedError(422, "a lease names each robot once")
    unknown = [name for name in names if name not in fleet]
    if unknown:
        known = ", ".join(sorted(fleet)) or "none"
        raise RefusedError(404, f"the fleet has no robot {', '.join(unknown)}; it has: {known}")
    for name in names:
        if fleet[name].objection:
            raise RefusedError(409, f"{name}: {fleet[name].objection}; ask for another")
    if not names and not any(robot.camera or not wish.camera for robot in fleet.values()):
        raise RefusedError(409, "no drone of the fleet could ever fit")


def lease_out(lease: Lease) -> LeaseOut:
    """A lease as the HTTP interface shows it."""
    named = list(lease.robots or lease.wanted)
    return LeaseOut.model_validate(lease).model_copy(update={"robots": named})


@dataclass(frozen=True, slots=True)
class Candidate:
    """One drone of the fleet, as it is now."""

    id: str
    camera: bool = False
    position: tuple[float, float] | None = None
    """Metres east and north; None if unknown, which is within no distance."""
    battery_minutes: float | None = None
    """Minutes of flight that its charge lasts; None if unknown, which is enough for none."""
    objection: str = ""
    """Why it cannot be flown now: out of service, out of reach, low; empty if it can."""
    busy: bool = False
    """Whether it still flies, for a lease that holds it or one that has ended: no other lease gets
    it before it has landed."""


Fleet: TypeAlias = Mapping[str, Candidate]
"""The whole fleet, by id."""


def _waited_for(lease: Lease, fleet: Fleet) -> frozenset[str]:
    """Robots that a queued lease could use now, were they all free: all that it names, or any."""
    if not lease.wanted:
        return frozenset(id_ for id_, robot in fleet.items() if _fits(lease, robot))
    ready = all(id_ in fleet and not fleet[id_].objection for id_ in lease.wanted)
    return frozenset(lease.wanted) if ready else frozenset()


def _distance(lease: Lease, robot: Candidate) -> float:
    """Metres from where a lease wants any drone; infinity for a drone of unknown position."""
    return math.inf if robot.position is None else math.dist(robot.position, lease.near)


def _fits(lease: Lease, robot: Candidate) -> bool:
    return (
        not robot.objection
        and (robot.camera or not lease.camera)
        and (lease.within is None or _distance(lease, robot) <= lease.within)
        and (lease.battery_minutes or 0.0) <= (robot.battery_minutes or 0.0)
    )


_MINUTE = 60.0
"""Seconds."""


def _expired(live: Iterable[Lease], now: float) -> list[Lease]:
    """Leases whose time is over, as ended."""
    return [
        replace(
            lease,
            state=LeaseState.ENDED,
            ended=lease.ends,
            end=LeaseEnd.EXPIRED,
            reason=f"its {lease.minutes:g} minutes are over",
        )
        for lease in live
        if lease.ends is not None and lease.ends <= now
    ]


def _grants(live: Collection[Lease], now: float, fleet: Fleet) -> list[Lease]:
    """Leases of the queue that can have their drones now, as granted.

    Each lease that must wait keeps the robots it waits for from all later ones: of several robots,
    those that are free stay so for it, or it might never find them free together.
    """
    taken = {robot for lease in live for robot in lease.robots}
    taken |= {id_ for id_, robot in fleet.items() if robot.busy}
    granted = []
    for lease in live:
        if lease.state is not LeaseState.QUEUED:
            continue
        robots = _waited_for(lease, fleet)
        free = robots - taken
        if not free or (lease.wanted and free != robots):
            taken |= robots
            continue
        # The nearest of any; the order by name makes it the same one each time.
        nearest = min(sorted(free), key=lambda id_: _distance(lease, fleet[id_]))
        chosen = lease.wanted or (nearest,)
        taken.update(chosen)
        granted.append(
            replace(
                lease,
                state=LeaseState.GRANTED,
                robots=chosen,
                granted=now,
                ends=now + lease.minutes * _MINUTE,
            )
        )
    return granted


def _is_waited_for(held: Lease, live: Iterable[Lease], fleet: Fleet) -> bool:
    """Whether a queued lease waits for a robot that `held` holds."""
    return any(
        lease.state is LeaseState.QUEUED and not _waited_for(lease, fleet).isdisjoint(held.robots)
        for lease in live
    )


_MOST_WAITING = 1000
_MOST_WAITING_OF_TENANT = 50
_LONGEST = 24 * 60
"""Minutes of a lease with all of its extensions."""


class LeaseBook:
    """Grants, queues and ends leases; every rule goes by an explicit now. Threads may share it.

    - One granted lease holds a robot; a lease of several robots is granted as a whole.
    - Leases are granted in the order in which they were asked for. A later one may be granted
      before an earlier one only if they share no robot that the earlier one waits for.
    - A lease of any one that fits waits for all that fit now: those whose charge, place or camera
      does not suffice may go to others meanwhile.
    - A lease that names a robot which cannot be flown now waits, and holds up nobody.
    - A drone that still comes home from an ended lease is granted when it has landed.
    - A granted lease ends after its minutes at the latest; from then on it holds nothing, even
      before `tick` has told so.

    Each change returns the leases whose state has changed since the last one returned, in the order
    in which they did: those that ended (whose flights are to be recalled) and those granted
    (whose flights may start). A change that raises leaves what it has to tell to the next.

    Ends hold even while the database fails; it is told of them with the next change. Requests,
    grants and extensions are carried out only if the database has taken them.
    """

    def __init__(
        self, table: Leases, new_id: Callable[[], str] = lambda: secrets.token_hex(8)
    ) -> None:
        """Go on with the leases of `table`; call `tick` next, for some may be over.

        Raises:
            StoreError: If the database does not answer.
        """
        self._table = table
        self._new_id = new_id
        self._lock = threading.RLock()
        self._live = {lease.id: lease for lease in table.live()}
        self._number = table.highest_number()
        self._unsaved: dict[str, Lease] = {}
        self._changes: list[Lease] = []

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
            RefusedError: With status 404 for an unknown robot; 409 for one that cannot be flown
                now, or if no drone of the fleet has the camera that is asked for; 422 for a robot
                named twice; 429 if the tenant, or all of them, wait for too many.
            StoreError: If the database does not take it; nothing is asked for then.
        """
        _check_wish(wish, fleet)
        with self._lock:
            self._settle(now, fleet)
            waiting = [
                lease.tenant for lease in self._live.values() if lease.state is LeaseState.QUEUED
            ]
            if waiting.count(tenant) >= _MOST_WAITING_OF_TENANT or len(waiting) >= _MOST_WAITING:
                raise RefusedError(429, "too many leases wait: give some back")
            # A number is used once, even by what the database may or may not have taken.
            self._number += 1
            lease = Lease(
                id=self._new_id(),
                number=self._number,
                tenant=tenant,
                account=account,
                asked=now,
                wanted=tuple(wish.robots or ()),
                area=None if wish.area is None else tuple(wish.area),
                **wish.model_dump(exclude={"robots", "area"}),
            )
            self._write(now, fleet, lease)
            return self._live[lease.id], self._take_changes()

    def extend(
        self, id_: str, minutes: float, now: float, fleet: Fleet, allowed: float = math.inf
    ) -> tuple[Lease, tuple[Lease, ...]]:
        """Let a granted lease end `minutes` later.

        Args:
            id_: The lease.
            minutes: How much later; positive and finite.
            now: Moment, seconds of Unix time.
            fleet: The drones as they are now.
            allowed: Minutes that the tenant's quota leaves, for all robots together.

        Returns:
            The lease with its new end, and the leases changed.

        Raises:
            RefusedError: With status 404 for a lease that is unknown or has ended; 409 if it is
                queued, or another waits for one of its robots; 403 if the quota is exceeded; 422
                for minutes that are not positive, or make it longer than a day.
            StoreError: If the database does not take it; the lease ends as before.
        """
        with self._lock:
            self._settle(now, fleet)
            lease = self._required(id_)
            if lease.ends is None:
                raise RefusedError(409, f"lease {id_} is queued: extend it when it is granted")
            if not 0 < minutes <= _LONGEST - lease.minutes:
                raise RefusedError(422, "a lease lasts a day at most, with its extensions")
            if _is_waited_for(lease, self._live.values(), fleet):
                raise RefusedError(409, f"another waits for a robot of lease {id_}")
            if minutes * len(lease.robots) > allowed:
                raise RefusedError(
                    403, f"the quota of {lease.tenant} leaves {max(0.0, allowed):.1f} minutes"
                )
            longer = replace(
                lease, minutes=lease.minutes + minutes, ends=lease.ends + minutes * _MINUTE
            )
            self._write(now, fleet, longer)
            return longer, self._take_changes()

    def end(
        self, id_: str, end: LeaseEnd, reason: str, now: float, fleet: Fleet
    ) -> tuple[Lease, ...]:
        """End a queued or granted lease at its tenant's wish or an operator's.

        Args:
            id_: Id of the lease.
            end: Whose wish it was.
            reason: Why, as the tenant reads it.
            now: Unix time, seconds.
            fleet: Drones of the provider, by id.

        Raises:
            RefusedError: With status 404 for a lease that is unknown or has ended.
        """
        with self._lock:
            self._drop(_expired(self._live.values(), now))
            lease = self._required(id_)
            self._drop([replace(lease, state=LeaseState.ENDED, ended=now, end=end, reason=reason)])
            self._settle(now, fleet)
            return self._take_changes()

    def advance(self, now: float, fleet: Fleet) -> tuple[Lease, ...]:
        """End what is over, and grant what has become free; call it every second or so.

        While the database fails, ends are returned, and grants wait.

        Args:
            now: Unix time, seconds.
            fleet: Drones of the provider, by id.
        """
        with self._lock:
            self._settle(now, fleet)
            return self._take_changes()

    def set_clock(self, seconds: float) -> None:
        """Move the ends of all leases by what the wall clock was set by: their minutes stay."""
        with self._lock:
            for lease in self._live.values():
                if lease.granted is not None and lease.ends is not None:
                    moved = replace(
                        lease, granted=lease.granted + seconds, ends=lease.ends + seconds
                    )
                    self._live[lease.id] = self._unsaved[lease.id] = moved

    def live(self) -> list[Lease]:
        """Leases queued or granted, in the queue's order."""
        with self._lock:
            return list(self._live.values())

    def get(self, id_: str) -> Lease | None:
        """A lease that is queued or granted; None for others, which the store knows."""
        return self._live.get(id_)

    def holder(self, robot: str, now: float) -> Lease | None:
        """The granted lease that holds a robot now; None if it is free.

        Args:
            robot: Id of the robot.
            now: Unix time, seconds.
        """
        for lease in self.live():
            if robot in lease.robots and lease.ends is not None and now < lease.ends:
                return lease
        return None

    def committed(self, tenant: str, now: float) -> float:
        """Minutes, times robots, that a tenant's leases hold from now on or wait for.

        Args:
            tenant: Name of the tenant.
            now: Unix time, seconds.
        """
        total = 0.0
        for lease in self.live():
            if lease.tenant == tenant:
                left = lease.minutes
                if lease.ends is not None:
                    left = max(0.0, lease.ends - now) / _MINUTE
                total += left * len(lease.robots or lease.wanted or ("any",))
        return total

    def _required(self, id_: str) -> Lease:
        lease = self._live.get(id_)
        if lease is None:
            raise RefusedError(404, f"there is no lease {id_} that is queued or granted")
        return lease

    def _settle(self, now: float, fleet: Fleet) -> None:
        """End what is over and grant what is free; while the database fails, nothing is granted."""
        self._drop(_expired(self._live.values(), now))
        try:
            self._write(now, fleet)
        except StoreError:
            return

    def _drop(self, ended: Iterable[Lease]) -> None:
        for lease in ended:
            del self._live[lease.id]
            self._unsaved[lease.id] = lease
            self._changes.append(lease)

    def _write(self, now: float, fleet: Fleet, *changed: Lease) -> None:
        """Take over `changed` and what can be granted with it, if the database does."""
        live = self._live | {lease.id: lease for lease in changed}
        granted = _grants(live.values(), now, fleet)
        live |= {lease.id: lease for lease in granted}
        rows = self._unsaved | {lease.id: live[lease.id] for lease in (*changed, *granted)}
        if rows:
            self._table.put(*rows.values())
        self._unsaved.clear()
        self._live = live
        self._changes += granted

    def _take_changes(self) -> tuple[Lease, ...]:
        changes, self._changes = tuple(self._changes), []
        return changes
