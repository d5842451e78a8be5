"""Proposed missions: kept, rehearsed, and flown once another account has approved exactly them."""

from __future__ import annotations

import math
import secrets
import time
from collections import defaultdict, deque
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any

from aerodaas.clock import WallOffset
from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.protocol.proposals import ApprovalIn, ApprovalOut, ProposalIn, ProposalOut
from aerodaas.protocol.schemas import MissionIn, MissionOut, MissionPhase, VerdictOut
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import RefusedError
from aerodaas.service.fleet.fleet_registry import FleetRegistry
from aerodaas.service.flights.environment import environment_of
from aerodaas.service.flights.orders import FlightOrder, FlightOrders, actuators_of
from aerodaas.service.leases.lease_service import LeaseService
from aerodaas.service.mission import ActiveMission, fingerprint_of, shown
from aerodaas.service.mission_table import MissionTable
from aerodaas.service.models.model_store import require_room
from aerodaas.service.proposals import (
    APPROVAL_SECONDS,
    VERDICT_SECONDS,
    Conditions,
    ProposalRecord,
    difference,
    lapse_reason,
    plain_text,
    proposal_hash,
    records_of,
    summary_of,
)
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Mission, Store

__all__ = ["ProposalService"]

_MOST_PROPOSALS = 20
"""Most proposals of an account that are not over: each is a folder, and a line for a person."""
_HOUR = 3600.0
_MOST_COMPARED = 100
"""Newest missions of a tenant among which the last approved one of the same name is looked for."""


class ProposalService:
    """Proposals among the missions of the service; safe in any thread.

    A proposal flies by an approval of exactly what it is now, which it uses up, or not at all.
    """

    def __init__(
        self,
        settings: ServiceSettings,
        store: Store,
        table: MissionTable,
        orders: FlightOrders,
        *,
        leases: LeaseService,
        registry: FleetRegistry,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Keep proposals in `table`; `clock` gives seconds as `time.monotonic` does."""
        self._settings = settings
        self._store = store
        self._table = table
        self._orders = orders
        self._leases = leases
        self._registry = registry
        self._clock = clock
        self._rehearsals: dict[str, deque[float]] = defaultdict(deque)
        """Moments of the rehearsals of the last hour, by account."""
        self.on_lapse: Callable[[Mission, str], None] = lambda _row, _text: None
        """Called with a proposal whose approval, or request of one, has lapsed, and why."""
        self._cameras = {
            sensor.full_id for sensor in settings.config.all_sensors() if sensor.type == "camera"
        }

    def propose(self, principal: Principal, proposal: ProposalIn) -> MissionOut:
        """Keep a proposal, or find the same one that is not over.

        Args:
            principal: The account that proposes.
            proposal: The document, and the minutes of its lease.

        Raises:
            RefusedError: If it cannot be flown here, or the account has too many.
        """
        document = proposal.document
        require_room(self._settings.state)
        _require_flyable_alone(document)
        robots = self._orders.check(principal, document)
        if proposal.parent is not None:
            self._own(principal, proposal.parent)
        fingerprint = fingerprint_of(proposal.model_copy(update={"why": ""}))
        id_ = secrets.token_hex(6)
        submission = MissionIn(document=document, minutes=proposal.minutes)
        row = Mission(
            id=id_,
            name=plain_text(document.name) or "mission",
            tenant=principal.tenant,
            account=principal.account,
            phase=MissionPhase.PROPOSED,
            robots=tuple(robots),
            submitted=time.time(),
            folder=str(self._table.path(id_)),
            request=submission.model_dump(mode="json", exclude={"document"}),
            reason="rehearse it next",
            fingerprint=fingerprint,
        )
        record = ProposalRecord(
            conditions=self._conditions(robots, self._orders.rehearsal(row)),
            parent=proposal.parent,
            why=plain_text(proposal.why),
            difference=self._difference(row, document, proposal.parent),
        )
        row = replace(row, request={**row.request, "proposal": record.model_dump(mode="json")})

        def find() -> ActiveMission | None:
            own = [
                active
                for active in self._table.missions.values()
                if active.row.account == principal.account
                and not active.over
                and active.is_proposal
            ]
            found = next((one for one in own if one.row.fingerprint == fingerprint), None)
            if found is None and len(own) >= _MOST_PROPOSALS:
                raise RefusedError(
                    429,
                    f"{principal.account} has {_MOST_PROPOSALS} proposals that are not over: "
                    "cancel some (DELETE /v1/missions/ID)",
                    retry_after=60.0,
                )
            return found

        return self.shown(self._table.add(row, document, find))

    def rehearse(self, principal: Principal, mission: str, seeds: int) -> MissionOut:
        """Have a proposal flown in simulation; one that is being rehearsed goes on.

        Args:
            principal: The account that proposed it.
            mission: Id of the proposal.
            seeds: Flights in simulation, each with another seed.

        Raises:
            RefusedError: If it waits for an approval or flies, or after too many of an hour.
        """
        with self._table.lock:
            active = self._own(principal, mission, MissionPhase.PROPOSED, MissionPhase.REHEARSING)
            if active.phase is MissionPhase.PROPOSED:
                self._count_rehearsal(principal.account)
                record = self._record(active).model_copy(update={"seeds": seeds})
                active.forget_rehearsal()
                self._set(active, MissionPhase.REHEARSING, "", record, verdict=None)
            return self.shown(active)

    def _count_rehearsal(self, account: str) -> None:
        """Count a rehearsal of an account; raises RefusedError for one too many."""
        begun, now = self._rehearsals[account], self._clock()
        while begun and now - begun[0] >= _HOUR:
            begun.popleft()
        most = self._settings.hourly_rehearsals
        if len(begun) >= most:
            wait = math.ceil(_HOUR - (now - begun[0])) if begun else _HOUR
            raise RefusedError(
                429,
                f"{account} has had {most} rehearsals within an hour: check documents before "
                f"(GET /v1/proposals/ID/check), and rehearse again in {wait:.0f} s",
                retry_after=wait,
            )
        begun.append(now)

    def begin(self, active: ActiveMission, order: FlightOrder) -> None:
        """Keep the conditions of a rehearsal that begins, if it is a proposal's."""
        if active.is_proposal:
            conditions = self._conditions(order.robots, order)
            record = self._record(active).model_copy(update={"conditions": conditions})
            active.change(
                request={**active.row.request, "proposal": record.model_dump(mode="json")}
            )

    def judge(self, active: ActiveMission, verdict: VerdictOut) -> None:
        """Keep the verdict on a proposal, which its proposer goes on from."""
        reason = "its rehearsal was good: request its approval"
        if not verdict.approved:
            reason = "its rehearsal was not good, as its verdict says: propose a better one"
        active.set_phase(MissionPhase.PROPOSED, reason, verdict=verdict.model_dump(mode="json"))

    def request_approval(self, principal: Principal, mission: str) -> MissionOut:
        """Ask for the approval of a proposal; one that waits for it goes on waiting.

        Args:
            principal: The account that proposed it.
            mission: Id of the proposal.

        Raises:
            RefusedError: If its newest rehearsal was not good, or says nothing any more.
        """
        with self._table.lock:
            active = self._own(
                principal, mission, MissionPhase.PROPOSED, MissionPhase.AWAITING_APPROVAL
            )
            if active.phase is MissionPhase.AWAITING_APPROVAL:
                return self.shown(active)
            verdict = active.row.verdict
            if verdict is None:
                text = f"{mission} has no rehearsal that counts: rehearse it, then request again"
                raise RefusedError(409, text)
            if not verdict["approved"]:
                reasons = "; ".join(verdict["reasons"])
                raise RefusedError(409, f"its rehearsal was not good: {reasons}: propose a better")
            self._require_valid(active)
            self._registry.require_fit(active.row.robots)
            document, minutes = active.document(), float(active.row.request["minutes"])
            self._leases.require_quota(
                principal.tenant,
                minutes * len(active.row.robots),
                cloud=self._orders.may_call_cloud(document),
            )
            record = self._record(active)
            told = self._difference(active.row, document, record.parent)
            record = record.model_copy(update={"difference": told})
            phase = MissionPhase.AWAITING_APPROVAL
            self._set(active, phase, "waits for an operator's approval", record)
            return self.shown(active)

    def approve(
        self, principal: Principal, active: ActiveMission, approval: ApprovalIn | None
    ) -> None:
        """Approve a proposal that waits for it; the caller holds the lock.

        Args:
            principal: The account that approves, which the caller has found to be a person's.
            active: The proposal.
            approval: What was approved, by its hash.

        Raises:
            RefusedError: For who proposed it, another hash, actuators that were not ticked, and
                what has lapsed.
        """
        row = active.row
        if principal.agent or principal.account == row.account:
            raise RefusedError(
                403,
                f"{principal.account} may not approve {row.id}: a person other than its "
                "proposer does",
            )
        if approval is None:
            raise RefusedError(
                409, f"{row.id} is a proposal: approve it by the hash that it is shown with"
            )
        self._require_valid(active)
        document, record = active.document(), self._record(active)
        present = self._hash(active, document)
        if approval.hash != present:
            raise RefusedError(
                409,
                f"{row.id} is not what was approved: it was {approval.hash[:12]}…, and is "
                f"{present[:12]}… since its last rehearsal: look at it again",
            )
        if missing := sorted(set(actuators_of(document)) - set(approval.actuators)):
            raise RefusedError(
                409, f"{row.id} moves {', '.join(missing)}: tick them, or have it proposed without"
            )
        at = self._unix(record.conditions)
        given = ApprovalOut(
            account=principal.account,
            at=at,
            lapses=at + APPROVAL_SECONDS,
            hash=present,
            envelope=approval.envelope,
            actuators=sorted(approval.actuators),
        )
        record = record.model_copy(update={"approval": given})
        self._set(active, MissionPhase.QUEUED, f"approved by {principal.account}", record)

    def has_lapsed(self, active: ActiveMission, *, limits: bool = False) -> bool:
        """Whether a proposal may not go on as it is, in which case it is proposed anew.

        Args:
            active: A mission that waits for its approval or its take-off; one that is no proposal
                never lapses.
            limits: Whether to look at the limits and the document, too, as before a take-off.
        """
        if not active.is_proposal or not (reason := self._lapse(active, limits=limits)):
            return False
        self._lapse_now(active, reason)
        return True

    def shown(self, active: ActiveMission) -> MissionOut:
        """A mission with its newest state, and with what an approver is shown of it."""
        found = shown(active)
        if not active.is_proposal:
            return found
        document, record = active.document(), self._record(active)
        minutes = float(active.row.request["minutes"])
        proposal = ProposalOut(
            hash=self._hash(active, document),
            document=document,
            minutes=minutes,
            parent=record.parent,
            change_of=record.change_of,
            why=record.why,
            summary=summary_of(document, minutes),
            difference=record.difference,
            records=records_of(document, self._cameras),
            actuators=sorted(actuators_of(document)),
            lapses=None if found.verdict is None else record.conditions.at + VERDICT_SECONDS,
            approval=record.approval,
        )
        return found.model_copy(update={"proposal": proposal})

    def _require_valid(self, active: ActiveMission) -> None:
        """Raise RefusedError for a verdict that says nothing any more; it is forgotten then."""
        if reason := self._lapse(active, limits=True):
            told = self._lapse_now(active, reason)
            raise RefusedError(409, told)

    def _lapse(self, active: ActiveMission, *, limits: bool) -> str:
        """Why a proposal's verdict or approval is not good any more; empty if it is."""
        record = self._record(active)
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
        if reason := lapse_reason(rehearsed, self._conditions(active.row.robots, order)):
            return reason
        if (
            limits
            and approval is not None
            and approval.hash != self._hash(active, active.document())
        ):
            return "the proposal is another one"
        return ""

    def _lapse_now(self, active: ActiveMission, reason: str) -> str:
        """Have a proposal go on from its beginning; returns the reason in words."""
        record = self._record(active)
        what = "approval" if record.approval is not None else "rehearsal"
        told = f"the {what} has lapsed: {reason}: rehearse it again"
        self.on_lapse(active.row, f"{self._hash(active, active.document())} {told}")
        self._leases.give_back(active.row)
        active.handing_over = False
        record = record.model_copy(update={"approval": None})
        changes = {"lease": None, "verdict": None}
        if active.phase is MissionPhase.PROPOSED:
            request = {**active.row.request, "proposal": record.model_dump(mode="json")}
            active.change(reason=told, request=request, **changes)
        else:
            self._set(active, MissionPhase.PROPOSED, told, record, **changes)
        return told

    def _set(
        self,
        active: ActiveMission,
        phase: MissionPhase,
        reason: str,
        record: ProposalRecord,
        **changes: object,
    ) -> None:
        request = {**active.row.request, "proposal": record.model_dump(mode="json")}
        active.set_phase(phase, reason, request=request, **changes)

    def _own(self, principal: Principal, mission: str, *phases: MissionPhase) -> ActiveMission:
        """A proposal of an account, in one of `phases`; raises RefusedError for any other."""
        active = self._table.seen(principal, mission)
        if not active.is_proposal:
            raise RefusedError(409, f"{mission} is no proposal: it was submitted to be flown")
        if active.row.account != principal.account:
            raise RefusedError(403, f"{mission} is {active.row.account}'s: propose one of your own")
        if phases and active.phase not in phases:
            raise RefusedError(
                409, f"{mission} is {active.phase.value}: propose another, or cancel this one"
            )
        return active

    def _record(self, active: ActiveMission) -> ProposalRecord:
        return ProposalRecord.model_validate(active.row.request["proposal"])

    def _hash(self, active: ActiveMission, document: MissionDocument) -> str:
        minutes = float(active.row.request["minutes"])
        return proposal_hash(document, self._record(active), minutes, active.row.verdict)

    def _unix(self, conditions: Conditions) -> float:
        """The present moment in Unix seconds, by the wall clock that the conditions have."""
        return self._clock() - conditions.offset.monotonic(0.0)

    def _conditions(self, robots: Collection[str], order: FlightOrder | None) -> Conditions:
        """Charge and wind now, and the limits by an order; no limits without it."""
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

    def _difference(self, row: Mission, document: MissionDocument, parent: str | None) -> list[str]:
        """What differs from the last approved mission of the same name, or from the parent."""
        newest = self._store.missions.newest(_MOST_COMPARED, row.tenant)
        approved = (
            one for one in newest if one.name == row.name and one.id != row.id and one.started
        )
        before = next((one.id for one in approved), parent)
        if before is None:
            return []
        earlier = self._table.any(before)
        told = difference(earlier.document(), document)
        return [f"Compared with {before}:", *(told or ["nothing differs."])]


def _require_flyable_alone(document: MissionDocument) -> None:
    """Raise RefusedError for a document that needs somebody at the user's side."""
    if here := document.here:
        raise RefusedError(
            422,
            f"{len(here)} analyses or conditions run at the user's side, where nobody is: a "
            "proposal names registered analyses alone",
        )
    if _has_key(document.model_dump(mode="json"), "$property"):
        raise RefusedError(
            422, "a proposal reads no file of a sensor's settings ($property): leave it out"
        )


def _has_key(value: object, key: str) -> bool:
    if isinstance(value, dict):
        return key in value or any(_has_key(one, key) for one in value.values())
    return isinstance(value, list) and any(_has_key(one, key) for one in value)


def _limits(config: EnvironmentConfig) -> dict[str, Any]:
    """Limits of a flight by robot, and what the simulated wind is."""
    limits = {robot.id: robot.limits.model_dump(mode="json") for robot in config.robots}
    wind = config.simulation.model_dump(mode="json", include={"wind", "gust", "world"})
    return {**limits, "the environment's world and wind": wind}
