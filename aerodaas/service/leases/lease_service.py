"""Leases of a provider's fleet: the book of leases, the present fleet and tenants' quotas."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Collection
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from aerodaas.clock import WallOffset
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.files.private_file import write_private
from aerodaas.protocol.schemas import LeaseIn, LeaseState, Role
from aerodaas.service.access.principal import Principal, sees
from aerodaas.service.access.quotas import Quotas
from aerodaas.service.errors import RefusedError
from aerodaas.service.fleet.fleet_registry import FleetRegistry
from aerodaas.service.leases.lease_table import Candidate, Fleet, LeaseBook
from aerodaas.service.store import Lease, LeaseEnd, Mission, Store

__all__ = ["LeaseService"]

_SET_SECONDS = 0.1
"""Least seconds by which the wall clock counts as set."""
_OFFSET = TypeAdapter(WallOffset)
_GIVEN_BACK = "given back"


class LeaseService:
    """Leases of all tenants; safe in any thread.

    Their ends are Unix times, for people. When the wall clock is set, also while no service runs,
    they are moved with it: a lease has as many minutes left as before.
    """

    def __init__(
        self,
        config: EnvironmentConfig,
        store: Store,
        registry: FleetRegistry,
        quotas: Quotas,
        clock: Path | None = None,
    ) -> None:
        """Go on with the leases that the database has.

        Args:
            config: The provider's environment.
            store: Its open database.
            registry: Tells of the drones.
            quotas: Of the tenants.
            clock: File of the wall clock's offset by which the database has its ends; None for one
                that a further service does not learn.
        """
        self._config = config
        self._store = store
        self._registry = registry
        self._quotas = quotas
        self._book = LeaseBook(store.leases)
        self._clock_file = clock
        self._clock_lock = threading.Lock()
        self._offset = self._known_offset()
        self.on_end: list[Callable[[Lease], None]] = []
        """Called with each lease that has ended, to recall its flights."""
        self.flying: Callable[[], Collection[str]] = tuple
        """Tells which robots are in flight: they may be on their way home from an ended lease."""
        self.on_extension: list[Callable[[Lease], None]] = []

    @property
    def offset(self) -> WallOffset:
        """Offset of the wall clock by which the leases have their ends."""
        self.now()
        return self._offset

    def now(self) -> float:
        """Seconds of Unix time; the leases are moved first if the wall clock was set."""
        with self._clock_lock:
            offset = WallOffset.read()
            step = offset.seconds - self._offset.seconds
            if abs(step) >= _SET_SECONDS:
                self._book.set_clock(step)
                self._offset = offset
                self._write_offset()
            return time.monotonic() + self._offset.seconds

    def _known_offset(self) -> WallOffset:
        """The last one that was written down in this boot of the machine, or the present one."""
        if self._clock_file is not None:
            with contextlib.suppress(OSError, ValidationError):
                known = _OFFSET.validate_json(self._clock_file.read_bytes())
                if known.current:
                    return known
        self._offset = WallOffset.read()
        self._write_offset()
        return self._offset

    def _write_offset(self) -> None:
        # Without it, a lease is shorter or longer by a step while no service runs.
        if self._clock_file is not None:
            with contextlib.suppress(OSError):
                write_private(self._clock_file, _OFFSET.dump_json(self._offset))

    def request(self, principal: Principal, wish: LeaseIn) -> Lease:
        """Ask for drones.

        Args:
            principal: The account that asks.
            wish: What is asked for.

        Returns:
            The lease, granted or queued.

        Raises:
            RefusedError: If it cannot be fulfilled, or a quota is used up.
        """
        return self._request(principal.tenant, principal.account, wish)

    def require_quota(self, tenant: str, minutes: float, *, cloud: bool = False) -> None:
        """Check that a tenant may have further flight.

        Args:
            tenant: Name of the tenant.
            minutes: Minutes, times robots.
            cloud: Whether what flies may call the cloud.

        Raises:
            RefusedError: If a quota is used up.
        """
        now = self.now()
        committed = self._book.committed(tenant, now)
        self._quotas.check(tenant, minutes, now, committed, cloud=cloud)

    def for_mission(self, mission: Mission) -> Lease:
        """Ask for the drones of a mission that brought no lease; raises RefusedError."""
        wish = LeaseIn(robots=list(mission.robots), minutes=float(mission.request["minutes"]))
        return self._request(mission.tenant, mission.account, wish)

    def _request(self, tenant: str, account: str, wish: LeaseIn) -> Lease:
        # Missions may have been submitted before any of them had a lease, which alone counts.
        self.require_quota(tenant, wish.minutes * len(wish.robots or [""]))
        lease, changed = self._book.request(wish, tenant, account, self.now(), self._fleet())
        self._announce(changed)
        return self.lease(lease.id)

    def require(self, principal: Principal, lease: str, robots: Collection[str]) -> None:
        """Check that a lease is the tenant's, goes on, and has these robots.

        Args:
            principal: The account that asks.
            lease: Id of the lease.
            robots: Ids of the robots.

        Raises:
            RefusedError: If one of these is not so.
        """
        found = self._own(principal, lease)
        if found.state is LeaseState.ENDED:
            raise RefusedError(409, f"the lease {lease} has ended: {found.reason}")
        held = found.robots or found.wanted
        missing = [robot for robot in robots if robot not in held]
        if missing:
            raise RefusedError(403, f"the lease {lease} is for {', '.join(held)}, not {missing[0]}")

    def lease(self, lease: str) -> Lease:
        """A lease, whoever asks; raises RefusedError if there is none."""
        return self._book.get(lease) or self._store.leases.require(lease)

    def seen(self, principal: Principal, lease: str) -> Lease:
        """A lease that this account may see.

        Args:
            principal: The account that asks.
            lease: Id of the lease.

        Raises:
            RefusedError: If it is another one.
        """
        found = self.lease(lease)
        if not sees(principal, found.tenant):
            raise RefusedError(404, f"there is no lease {lease}")
        return found

    def all_seen(self, principal: Principal) -> list[Lease]:
        """Leases that go on, and which this account may see."""
        return [one for one in self._book.live() if sees(principal, one.tenant)]

    def granted(self) -> list[Lease]:
        """All that are granted now."""
        return [one for one in self._book.live() if one.state is LeaseState.GRANTED]

    def extend(self, principal: Principal, lease: str, minutes: float) -> Lease:
        """Let a lease end later.

        Args:
            principal: The account that asks.
            lease: Id of the lease.
            minutes: By how much.

        Raises:
            RefusedError: If the lease or the quota does not allow it.
        """
        found, now = self._own(principal, lease), self.now()
        committed = self._book.committed(found.tenant, now)
        left = self._quotas.left(found.tenant, now, committed)
        extended, changed = self._book.extend(
            lease, minutes, now, self._fleet(), left.flight_minutes
        )
        self._announce(changed)
        for call in self.on_extension:
            call(extended)
        return extended

    def end(self, principal: Principal, lease: str) -> Lease:
        """Give a lease back, or revoke another tenant's as an operator; drones come home.

        Args:
            principal: The account that asks.
            lease: Id of the lease.

        Raises:
            RefusedError: If the account may do neither.
        """
        found = self.seen(principal, lease)
        if found.tenant == principal.tenant and principal.role.reaches(Role.PILOT):
            end, reason = LeaseEnd.GIVEN_BACK, _GIVEN_BACK
        elif principal.role.reaches(Role.OPERATOR):
            end, reason = LeaseEnd.REVOKED, f"revoked by {principal.account}"
        else:
            raise RefusedError(403, f"the lease {lease} is {found.tenant}'s")
        self._end(lease, end, reason)
        return self.lease(lease)

    def give_back(self, mission: Mission) -> None:
        """Give back the lease that was asked for with a mission, once that is over."""
        own = mission.request.get("lease") is None
        if own and mission.lease is not None and self._book.get(mission.lease) is not None:
            self._end(mission.lease, LeaseEnd.GIVEN_BACK, _GIVEN_BACK)

    def holder(self, robot: str) -> Lease | None:
        """The lease that holds a robot now."""
        return self._book.holder(robot, self.now())

    def advance(self) -> None:
        """End what is over, and grant what has become free."""
        self._announce(self._book.advance(self.now(), self._fleet()))

    def _own(self, principal: Principal, lease: str) -> Lease:
        found = self.seen(principal, lease)
        if found.tenant != principal.tenant and not principal.role.reaches(Role.OPERATOR):
            raise RefusedError(403, f"the lease {lease} is {found.tenant}'s")
        return found

    def _end(self, lease: str, end: LeaseEnd, reason: str) -> None:
        self._announce(self._book.end(lease, end, reason, self.now(), self._fleet()))

    def _announce(self, changed: Collection[Lease]) -> None:
        for lease in changed:
            if lease.state is LeaseState.ENDED:
                for call in self.on_end:
                    call(lease)

    def _fleet(self) -> Fleet:
        states, busy, fleet = self._registry.states, self.flying(), {}
        for robot in self._config.robots:
            state = states[robot.id]
            place = state.position or robot.start
            charge = _charge(robot, state.battery)
            usable = None if charge is None else charge - robot.limits.battery_return
            minutes = robot.limits.endurance / 60.0
            fleet[robot.id] = Candidate(
                robot.id,
                camera=any(one.type == "camera" for one in robot.sensors),
                position=(place[0], place[1]),
                battery_minutes=None if usable is None else max(0.0, usable) * minutes,
                objection="" if robot.id in busy else self._registry.objection(robot.id),
                busy=robot.id in busy,
            )
        return fleet


def _charge(robot: RobotConfig, known: float | None) -> float | None:
    """Charge of a drone, 0 to 1: that of the simulation's settings for one that has yet to fly."""
    if known is None and robot.driver == "simulated":
        return float(robot.settings.get("battery", 1.0))
    return known
