"""Proposed missions: kept, rehearsed, and flown once another account has approved exactly them."""

from __future__ import annotations

import math
import secrets
import time
from collections import defaultdict, deque
from collections.abc import Callable
from dataclasses import replace

from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.errors import AeroDaaSError
from aerodaas.mission.commands import Answer
from aerodaas.protocol.proposals import (
    ApprovalIn,
    ApprovalOut,
    ChangeIn,
    CheckReport,
    ProposalIn,
    ProposalOut,
)
from aerodaas.protocol.schemas import MissionIn, MissionOut, MissionPhase, VerdictOut
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import RefusedError
from aerodaas.service.fleet.fleet_registry import FleetRegistry
from aerodaas.service.flights.orders import FlightOrder, FlightOrders, actuators_of
from aerodaas.service.leases.lease_service import LeaseService
from aerodaas.service.mission import ActiveMission, fingerprint_of, shown
from aerodaas.service.mission_table import MissionTable
from aerodaas.service.models.model_store import require_room
from aerodaas.service.proposals.changes import FlightChanges
from aerodaas.service.proposals.conditions import FlightConditions, hash_of, record_of
from aerodaas.service.proposals.record import (
    APPROVAL_SECONDS,
    VERDICT_SECONDS,
    ProposalRecord,
    encloses,
    plain_text,
)
from aerodaas.service.proposals.summary import difference, records_of, summary_of
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Mission, Store

__all__ = ["ProposalService"]

_MOST_PROPOSALS = 20
"""Most proposals of an account that are not over: each is a folder, and a line for a person."""
_MOST_WAYPOINTS = 2000
"""Most waypoints of a proposal: a check of more keeps a core busy for seconds."""
_HOUR, _MINUTE = 3600.0, 60.0
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
        self._changes = FlightChanges()
        self._conditions = FlightConditions(settings, orders, registry, clock)
        self._rehearsals: dict[str, deque[float]] = defaultdict(deque)
        """Moments of the rehearsals of the last hour, by account."""
        self.audit: Callable[[str, Mission, str], None] = lambda _action, _row, _text: None
        """Called with what the service itself does to a proposal, and its hash and reason."""
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
        _require_for_agents(document)
        robots = self._orders.check(principal, document)
        if proposal.parent is not None:
            self._own(principal, proposal.parent)
        row = self._row(principal, document, robots, proposal.minutes)
        row = replace(
            row,
            reason="rehearse it next",
            fingerprint=fingerprint_of(proposal.model_copy(update={"why": ""})),
        )
        record = ProposalRecord(
            conditions=self._conditions.present(robots, self._orders.rehearsal(row)),
            parent=proposal.parent,
            why=plain_text(proposal.why),
            difference=self._difference(row, document, proposal.parent),
        )
        return self._added(row, document, record)

    def change(self, principal: Principal, mission: str, change: ChangeIn) -> MissionOut:
        """Keep a change of a mission in flight, and have it rehearsed from where its robot is.

        It is applied at once where it lies within what was approved beforehand; otherwise it waits
        for an approval of its own.

        Args:
            principal: The account that proposed the mission.
            mission: Id of the mission.
            change: The robot, and the waypoints that replace its own.

        Raises:
            RefusedError: If the robot does not take other waypoints now, its check finds a reason
                against these, or after too many rehearsals of an hour.
        """
        host = self._own(principal, mission)
        before = record_of(host)
        document = self._changes.document(host, change, before.approval)
        lease = None if host.row.lease is None else self._leases.lease(host.row.lease)
        left = 0.0 if lease is None or lease.ends is None else lease.ends - self._leases.now()
        if left <= 0.0:
            raise RefusedError(409, f"the lease of {mission} has ended")
        row = self._row(principal, document, [change.robot], left / _MINUTE)
        row = replace(
            row,
            phase=MissionPhase.REHEARSING,
            fingerprint=fingerprint_of(change.model_copy(update={"why": ""})),
        )
        record = ProposalRecord(
            conditions=self._conditions.present(row.robots, self._orders.rehearsal(row)),
            change_of=mission,
            why=plain_text(change.why),
            difference=self._difference(row, document, mission),
        )
        self._conditions.require_checked(row, document)
        return self._added(row, document, record)

    def _row(
        self, principal: Principal, document: MissionDocument, robots: list[str], minutes: float
    ) -> Mission:
        """A new row of a proposal, still without its record."""
        id_ = secrets.token_hex(6)
        submission = MissionIn(document=document, minutes=minutes)
        return Mission(
            id=id_,
            name=plain_text(document.name) or "mission",
            tenant=principal.tenant,
            account=principal.account,
            phase=MissionPhase.PROPOSED,
            robots=tuple(robots),
            submitted=time.time(),
            folder=str(self._table.path(id_)),
            request=submission.model_dump(mode="json", exclude={"document"}),
        )

    def _added(self, row: Mission, document: MissionDocument, record: ProposalRecord) -> MissionOut:
        """Keep a proposal, or find the same one that is not over; raises RefusedError."""
        row = replace(row, request={**row.request, "proposal": record.model_dump(mode="json")})

        def find() -> ActiveMission | None:
            own = [
                active
                for active in self._table.missions.values()
                if active.row.account == row.account and not active.over and active.is_proposal
            ]
            for active in own:
                same = active.row.fingerprint == row.fingerprint
                if same and record_of(active).change_of == record.change_of:
                    return active
            if len(own) >= _MOST_PROPOSALS:
                raise RefusedError(
                    429,
                    f"{row.account} has {_MOST_PROPOSALS} proposals that are not over: cancel some",
                    retry_after=60.0,
                )
            if row.phase is MissionPhase.REHEARSING:
                self._count_rehearsal(row.account)
            return None

        return self.shown(self._table.add(row, document, find))

    def check(self, principal: Principal, mission: str) -> CheckReport:
        """Check a proposal without flying, from the present charge of its robots.

        Args:
            principal: The account that asks.
            mission: Id of the proposal.

        Raises:
            RefusedError: If there is none, or others are being checked.
        """
        active = self._table.seen(principal, mission)
        if not active.is_proposal:
            raise RefusedError(409, f"{mission} is no proposal: it was submitted to be flown")
        return self._conditions.report(active.row, active.document())

    def rehearse(self, principal: Principal, mission: str, seeds: int) -> MissionOut:
        """Have a proposal flown in simulation; one that is being rehearsed goes on.

        Args:
            principal: The account that proposed it.
            mission: Id of the proposal.
            seeds: Flights in simulation, each with another seed.

        Raises:
            RefusedError: If its check finds a reason against it, if it waits for an approval or
                flies, or after too many of an hour.
        """
        phases = (MissionPhase.PROPOSED, MissionPhase.REHEARSING)
        active = self._own(principal, mission, *phases)
        self._conditions.require_checked(active.row, active.document())
        with self._table.lock:
            active = self._own(principal, mission, *phases)
            if active.phase is MissionPhase.PROPOSED:
                self._count_rehearsal(principal.account)
                record = record_of(active).model_copy(update={"seeds": seeds})
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
                f"{account} has had {most} rehearsals within an hour: check documents first, and "
                f"rehearse again in {wait:.0f} s",
                retry_after=wait,
            )
        begun.append(now)

    def begin(self, active: ActiveMission, order: FlightOrder) -> None:
        """Keep the conditions of a rehearsal that begins, if it is a proposal's."""
        if not active.is_proposal:
            return
        record = record_of(active)
        if (host := self._host(record)) is not None:
            active.write(self._changes.renewed(host, active.document()))
        conditions = self._conditions.present(order.robots, order)
        self._keep(active, record.model_copy(update={"conditions": conditions}))

    def judge(self, active: ActiveMission, verdict: VerdictOut) -> None:
        """Keep the verdict on a proposal, which its proposer goes on from.

        A change is applied, waits for an approval, or is over.
        """
        record, kept = record_of(active), verdict.model_dump(mode="json")
        if (host := self._host(record)) is None:
            reason = "its rehearsal was good: request its approval"
            if not verdict.approved:
                reason = "its rehearsal was not good, as its verdict says: propose a better one"
            active.set_phase(MissionPhase.PROPOSED, reason, verdict=kept)
            return
        active.change(verdict=kept)
        allowed = record_of(host).approval
        if not verdict.approved:
            self._end(active, MissionPhase.REFUSED, "; ".join(verdict.reasons))
        elif reason := self._conditions.lapse(active, limits=True):
            self._lapse_now(active, reason)
        else:
            objection = "no changes were approved beforehand"
            if allowed is not None:
                document = active.document()
                objection = self._changes.envelope_objection(host, document, verdict, allowed)
            if objection:
                told = f"waits for an operator's approval: {objection}"
                active.set_phase(MissionPhase.AWAITING_APPROVAL, told)
            else:
                self._apply(active, host)

    def cancel_obsolete(self, active: ActiveMission) -> bool:
        """Cancel a change whose mission is over; returns whether it is one."""
        if not active.is_proposal or (name := record_of(active).change_of) is None:
            return False
        host = self._table.missions.get(name)
        if host is not None and host.phase is MissionPhase.FLYING:
            return False
        active.end_rehearsal()
        self._end(active, MissionPhase.CANCELLED, f"{name}, which it changes, is over")
        return True

    def _apply(self, active: ActiveMission, host: ActiveMission) -> None:
        """Have a change flown, if its way from where the robot is now has no findings either."""
        try:
            document = self._changes.renewed(host, active.document())
            self._conditions.require_checked(active.row, document)
            answer = self._changes.apply(host, document)
        except AeroDaaSError as error:
            answer = Answer(accepted=False, text=str(error))
        if not answer.accepted:
            self._end(active, MissionPhase.REFUSED, answer.text)
            return
        told = f"{host.row.id} flies it"
        if answer.refused:
            told += f" without {len(answer.refused)} waypoints, which the drone has refused"
        self._end(active, MissionPhase.APPLIED, told)

    def _end(self, active: ActiveMission, phase: MissionPhase, reason: str) -> None:
        told = f"{hash_of(active, active.document())} {phase.value}: {reason}"
        self.audit("proposal.end", active.row, told)
        active.set_phase(phase, reason, ended=time.time())

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
            record = record_of(active)
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
        document, record = active.document(), record_of(active)
        present = hash_of(active, document)
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
        if approval.envelope is not None and not encloses(approval.envelope.area):
            raise RefusedError(
                422,
                "the envelope's area encloses nothing or crosses itself: name its corners in "
                "their order",
            )
        at = self._conditions.unix(record.conditions)
        given = ApprovalOut(
            account=principal.account,
            at=at,
            lapses=at + APPROVAL_SECONDS,
            hash=present,
            envelope=approval.envelope,
            actuators=sorted(approval.actuators),
        )
        record = record.model_copy(update={"approval": given})
        if (host := self._host(record)) is None:
            self._set(active, MissionPhase.QUEUED, f"approved by {principal.account}", record)
        else:
            self._keep(active, record)
            self._apply(active, host)

    def has_lapsed(self, active: ActiveMission, *, limits: bool = False) -> bool:
        """Whether a proposal may not go on as it is, in which case it is proposed anew.

        Args:
            active: A mission that waits for its approval or its take-off; one that is no proposal
                never lapses.
            limits: Whether to look at the limits and the document, too, as before a take-off.
        """
        if not active.is_proposal or not (reason := self._conditions.lapse(active, limits=limits)):
            return False
        self._lapse_now(active, reason)
        return True

    def shown(self, active: ActiveMission) -> MissionOut:
        """A mission with its newest state, and with what an approver is shown of it."""
        found = shown(active)
        if not active.is_proposal:
            return found
        document, record = active.document(), record_of(active)
        minutes = float(active.row.request["minutes"])
        proposal = ProposalOut(
            hash=hash_of(active, document),
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

    def approved_hash(self, mission: str) -> str:
        """Hash by which a mission that is not over was approved; empty for any other."""
        active = self._table.missions.get(mission)
        approval = record_of(active).approval if active and active.is_proposal else None
        return "" if approval is None else approval.hash

    def _require_valid(self, active: ActiveMission) -> None:
        """Raise RefusedError for a verdict that says nothing any more; it is forgotten then."""
        if reason := self._conditions.lapse(active, limits=True):
            told = self._lapse_now(active, reason)
            raise RefusedError(409, told)

    def _lapse_now(self, active: ActiveMission, reason: str) -> str:
        """Have a proposal go on from its beginning; returns the reason in words."""
        record = record_of(active)
        what = "approval" if record.approval is not None else "rehearsal"
        told = f"the {what} has lapsed: {reason}: rehearse it again"
        if record.change_of is not None:
            self._end(active, MissionPhase.REFUSED, told)
            return told
        self.audit("proposal.lapse", active.row, f"{hash_of(active, active.document())} {told}")
        self._leases.give_back(active.row)
        active.handing_over = False
        record = record.model_copy(update={"approval": None})
        changes = {"lease": None, "verdict": None}
        if active.phase is MissionPhase.PROPOSED:
            self._keep(active, record, reason=told, **changes)
        else:
            self._set(active, MissionPhase.PROPOSED, told, record, **changes)
        return told

    def _keep(self, active: ActiveMission, record: ProposalRecord, **changes: object) -> None:
        request = {**active.row.request, "proposal": record.model_dump(mode="json")}
        active.change(request=request, **changes)

    def _host(self, record: ProposalRecord) -> ActiveMission | None:
        """The mission that a proposal changes; None for a mission of its own."""
        return None if record.change_of is None else self._table.any(record.change_of)

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

    def _difference(self, row: Mission, document: MissionDocument, parent: str | None) -> list[str]:
        """Difference to the last approved mission of the same name, or to the parent."""
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


def _require_for_agents(document: MissionDocument) -> None:
    """Raise RefusedError for a document that is too long, or asks for what no agent may have."""
    if sum(len(entry.waypoints) for entry in document.navigation) > _MOST_WAYPOINTS:
        raise RefusedError(
            422, f"a proposal has at most {_MOST_WAYPOINTS} waypoints: propose it in parts"
        )
    triggers = [one for entry in document.analyses for one in entry.triggers]
    if any(one.command == "resume_mission" for one in triggers):
        raise RefusedError(
            422, "a proposal resumes no paused drone by a trigger, for a person may have paused it"
        )
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
