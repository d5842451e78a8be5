"""SFQ-DEMS: DEMS for each tenant, and start-time fair queueing of edge and cloud between them.

Start-time fair queueing: see `FairQueue`. Trunk reservation: Key, "Optimal control and trunk
reservation in loss networks", Probability in the Engineering and Informational Sciences 4(2), 1990.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.analytics.base import (
    AnalyticsScheduler,
    Decision,
    Drop,
    Resources,
    Result,
    RunOnEdge,
    SendToCloud,
    Task,
    TaskPlace,
    WakeAt,
)
from aerodaas.schedulers.analytics.fair_queue import FairQueue
from aerodaas.schedulers.analytics.published.dems import Dems

__all__ = ["SfqDems"]

_ACTIVE = 10 * NANOSECONDS
"""A tenant without a new task for so long gives its share to the others."""


class _TenantDems(Dems):
    """DEMS of one tenant, whose edge is slower than the machine's by the tenant's share."""

    def __init__(self) -> None:
        super().__init__()
        self._share = 1.0
        """Of the edge, 0 to 1."""

    def take_share(self, share: float) -> None:
        """Plan for another share of the edge."""
        self._share = share
        self.measure_queue()

    def occupied(self, task: Task) -> int:
        """The task's time on the tenant's share of the edge."""
        return round(task.profile.edge_time / self._share)


@dataclass
class _Tenant:
    """One tenant's scheduler and what it has in hand."""

    dems: _TenantDems
    weight: float
    seen: int
    """Arrival of its newest task."""
    in_cloud: int = 0
    held: list[SendToCloud] = field(default_factory=list)
    """Sendings that wait for a slot."""


class SfqDems(AnalyticsScheduler):
    """Shares edge and cloud between tenants by weight; each tenant's tasks are scheduled by DEMS.

    The idle edge serves the tenant with the least start tag that has a task to run or to steal
    back; so it is never idle while DEMS would run a task of any tenant. A tenant admits to its
    queue what meets its deadline on its share alone. A cloud slot goes to the waiting tenant with
    the least start tag; the last slots, one for each other tenant that is below its share, are
    kept from tenants above theirs.
    """

    def __init__(self) -> None:
        self._tenants: dict[str, _Tenant] = {}
        self._edge = FairQueue()
        self._cloud = FairQueue()
        self._in_cloud = 0
        """Tasks of all tenants there."""
        self._sharing: list[_Tenant] = []
        """Between whom the edge is divided."""

    def task_arrived(self, task: Task, now: int) -> Iterable[Decision]:
        """Give the task to its tenant's DEMS."""
        name = task.profile.tenant
        tenant = self._tenants.get(name)
        if tenant is None:
            tenant = self._tenants[name] = _Tenant(_TenantDems(), task.profile.weight, now)
            tenant.dems.start(self.resources, now)
            self._tell_edge(max(one.dems.free_at for one in self._tenants.values()))
        tenant.seen = now
        self._divide(now)
        return self._gated(name, tenant.dems.task_arrived(task, now), now)

    def executor_idle(self, now: int) -> Iterable[Decision]:
        """Serve the tenant with the least start tag."""
        decisions: list[Decision] = []
        for name in sorted(self._tenants, key=self._edge.tag):
            dems = self._tenants[name].dems
            for decision in self._gated(name, dems.executor_idle(now), now):
                decisions.append(decision)
                if isinstance(decision, RunOnEdge):
                    taken = decision.task.profile.edge_time
                    self._edge.serve(name, taken / self._tenants[name].weight)
                    self._tell_edge(dems.free_at)
                    return decisions
        return decisions

    def task_finished(self, result: Result, now: int) -> Iterable[Decision]:
        """Tell the tenant's DEMS, and give a free slot to whose turn it is."""
        name = result.task.profile.tenant
        tenant = self._tenants[name]
        if result.place is TaskPlace.EDGE:
            self._tell_edge(now)
        else:
            tenant.in_cloud -= 1
            self._in_cloud -= 1
        decisions = self._gated(name, tenant.dems.task_finished(result, now), now)
        return decisions + self._fill(now)

    def timer(self, now: int) -> Iterable[Decision]:
        """Let tasks leave whose latest start has come, and give up those that no slot took."""
        decisions: list[Decision] = []
        for name, tenant in self._tenants.items():
            decisions += self._gated(name, tenant.dems.timer(now), now)
            if tenant.held:
                decisions += _expired(tenant, now)
        return decisions + self._fill(now)

    def resources_changed(self, resources: Resources, now: int) -> Iterable[Decision]:
        """Tell all tenants' DEMS; without a cloud, nothing waits for it."""
        self.resources = resources
        decisions: list[Decision] = []
        for name, tenant in self._tenants.items():
            decisions += self._gated(name, tenant.dems.resources_changed(resources, now), now)
            if not resources.cloud_slots:
                decisions += [Drop(one.task, "the cloud is gone") for one in tenant.held]
                tenant.held.clear()
        return decisions + self._fill(now)

    def _active(self, now: int) -> list[_Tenant]:
        return [one for one in self._tenants.values() if now - one.seen <= _ACTIVE]

    def _divide(self, now: int) -> None:
        """Divide the edge by weight between the tenants that are there."""
        sharing = self._active(now)
        if sharing == self._sharing:
            return
        self._sharing = sharing
        whole = sum(one.weight for one in sharing)
        for one in sharing:
            one.dems.take_share(one.weight / whole)

    def _tell_edge(self, free_at: int) -> None:
        """All tenants' DEMS expect the edge to be free at the same time."""
        for one in self._tenants.values():
            one.dems.free_at = free_at

    def _gated(self, name: str, decisions: Iterable[Decision], now: int) -> list[Decision]:
        """Decisions of a tenant's DEMS; what it sends waits until a slot is its own."""
        gated: list[Decision] = []
        for decision in decisions:
            if not isinstance(decision, SendToCloud):
                gated.append(decision)
                continue
            held = self._tenants[name].held
            held.append(decision)
            gated += self._fill(now)
            if decision in held and decision.latest_start is not None:
                gated.append(WakeAt(max(now, decision.latest_start) + 1))
        return gated

    def _fill(self, now: int) -> list[Decision]:
        """Start what waits for the cloud, as far as there are slots, in the order of start tags."""
        started: list[Decision] = []
        while waiting := [
            name for name, one in self._tenants.items() if one.held and self._may_send(name, now)
        ]:
            name = min(waiting, key=self._cloud.tag)
            tenant = self._tenants[name]
            decision = tenant.held.pop(0)
            if decision.latest_start is not None and decision.latest_start < now:
                started.append(Drop(decision.task, "no slot in the cloud"))
                continue
            tenant.in_cloud += 1
            self._in_cloud += 1
            self._cloud.serve(name, decision.task.profile.cloud_time / tenant.weight)
            started.append(decision)
        return started

    def _may_send(self, name: str, now: int) -> bool:
        slots = self.resources.cloud_slots
        free = slots - self._in_cloud
        if free <= 0 or free >= len(self._tenants):
            # At most one slot is kept for each other tenant.
            return free > 0
        active = self._active(now)
        whole = sum(one.weight for one in active)

        def is_below(one: _Tenant) -> bool:
            return one.in_cloud < slots * one.weight / max(whole, one.weight)

        own = self._tenants[name]
        others = [one for one in active if one is not own and is_below(one)]
        kept = 0 if is_below(own) or slots <= len(active) else len(others)
        return free > kept


def _expired(tenant: _Tenant, now: int) -> list[Decision]:
    late = [one for one in tenant.held if one.latest_start is not None and one.latest_start < now]
    for one in late:
        tenant.held.remove(one)
    return [Drop(one.task, "no slot in the cloud") for one in late]
