"""What a proposal would fly under now: its check, and whether its rehearsal still counts."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Collection
from typing import Any

from aerodaas.clock import WallOffset
from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.documents.checking import check_document
from aerodaas.protocol.proposals import CheckReport
from aerodaas.protocol.schemas import MissionPhase
from aerodaas.service.errors import RefusedError
from aerodaas.service.fleet.fleet_registry import FleetRegistry
from aerodaas.service.flights.environment import environment_of
from aerodaas.service.flights.orders import FlightOrder, FlightOrders
from aerodaas.service.mission import ActiveMission
from aerodaas.service.proposals.record import (
    APPROVAL_SECONDS,
    CHARGE_POINTS,
    VERDICT_SECONDS,
    Conditions,
    ProposalRecord,
    lapse_reason,
    proposal_hash,
)
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Mission

__all__ = ["FlightConditions", "hash_of", "record_of"]

_CHECK_PATIENCE = 10.0
"""Wall seconds for which a check waits for others."""


def record_of(active: ActiveMission) -> ProposalRecord:
    """Record of a proposal, as its row keeps it."""
    return ProposalRecord.model_validate(active.row.request["proposal"])


def hash_of(active: ActiveMission, document: MissionDocument) -> str:
    """Hash of a proposal as it is now.

    Args:
        active: The proposal.
        document: Its document.
    """
    minutes = float(active.row.request["minutes"])
    return proposal_hash(document, record_of(active), minutes, active.row.verdict)


class FlightConditions:
    """Charge, wind and limits of proposals' flights; safe in any thread."""

    def __init__(
        self,
        settings: ServiceSettings,
        orders: FlightOrders,
        registry: FleetRegistry,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Look at the present; `clock` gives seconds as `time.monotonic` does."""
        self._settings = settings
        self._orders = orders
        self._registry = registry
        self._clock = clock
        self._checking = threading.Lock()

    def report(self, row: Mission, document: MissionDocument) -> CheckReport:
        """Check a document without flying, from the present charge.

        Args:
            row: Row of its proposal.
            document: The document.

        Raises:
            RefusedError: If others are being checked.
        """
        order = self._orders.rehearsal(row)
        config = environment_of(order.model_copy(update={"rehearsal": False}))
        # One at a time: each takes a core, which flights and the service need.
        if not self._checking.acquire(timeout=_CHECK_PATIENCE):
            text = "other proposals are being checked: ask again in a moment"
            raise RefusedError(429, text, retry_after=_CHECK_PATIENCE)
        try:
            return check_document(document, config, battery=order.battery, minutes=order.minutes)
        finally:
            self._checking.release()

    def require_checked(self, row: Mission, document: MissionDocument) -> None:
        """Refuse a document with findings, which a rehearsal would only take longer to find.

        Args:
            row: Row of its proposal.
            document: The document.

        Raises:
            RefusedError: For the first of the findings, with its remedy.
        """
        report = self.report(row, document)
        if not report.passed:
            first, *others = report.findings
            more = f" ({len(others)} more findings)" if others else ""
            raise RefusedError(409, f"its check found: {first.text}; {first.remedy}{more}")

    def unix(self, conditions: Conditions) -> float:
        """The present moment in Unix seconds, by the wall clock that the conditions have."""
        return self._clock() - conditions.offset.monotonic(0.0)

    def present(self, robots: Collection[str], order: FlightOrder | None) -> Conditions:
        """Conditions of a flight now.

        Args:
            robots: Ids of its robots.
            order: Its order, which has the limits; None to leave them out.
        """
        offset = WallOffset.read()
        reports = [self._registry.report(name).wind for name in robots]
        simulation = self._settings.config.simulation
        simulated = math.hypot(*simulation.wind[:2]) + 2.0 * simulation.gust
        return Conditions(
            at=self._clock() + offset.seconds,
            offset=offset,
            battery=self._orders.charges(robots),
            wind=max([simulated, *(wind for wind in reports if wind is not None)]),
            limits={} if order is None else _limits(environment_of(order)),
        )

    def lapse(self, active: ActiveMission, *, limits: bool) -> str:
        """Why a proposal's verdict or approval is not good any more; empty if it is.

        Args:
            active: The proposal.
            limits: Whether to look at limits and document, too, which takes longer.
        """
        record = record_of(active)
        approval, rehearsed = record.approval, record.conditions
        if active.phase is MissionPhase.QUEUED and approval is None:
            return "there is none"
        since, longest = rehearsed.at, VERDICT_SECONDS
        if approval is not None:
            since, longest = approval.at, APPROVAL_SECONDS
        age = self._clock() - rehearsed.offset.monotonic(since)
        if not 0 <= age + 1.0 <= longest + 1.0:
            return f"it is {age:.0f} s old, and is good for {longest:.0f} s"
        order = self._orders.rehearsal(active.row) if limits else None
        present = self.present(active.row.robots, order)
        if reason := lapse_reason(rehearsed, present, self._spare(active, record)):
            return reason
        if limits and approval is not None and approval.hash != hash_of(active, active.document()):
            return "the proposal is another one"
        return ""

    def _spare(self, active: ActiveMission, record: ProposalRecord) -> float:
        """Share of a full charge that a robot may have lost since its rehearsal.

        In flight that is what the rehearsal has brought home beyond the robot's reserve.
        """
        used = None if active.row.verdict is None else active.row.verdict["battery_used"]
        charge = list(record.conditions.battery.values())
        if record.change_of is None or used is None or not charge:
            return CHARGE_POINTS
        (robot,) = active.row.robots
        limits = next(one.limits for one in self._settings.config.robots if one.id == robot)
        return max(0.0, charge[0] - used - limits.battery_return)


def _limits(config: EnvironmentConfig) -> dict[str, Any]:
    """Limits of a flight by robot, and what the simulated wind is."""
    limits = {robot.id: robot.limits.model_dump(mode="json") for robot in config.robots}
    wind = config.simulation.model_dump(mode="json", include={"wind", "gust", "world"})
    return {**limits, "the environment's world and wind": wind}
