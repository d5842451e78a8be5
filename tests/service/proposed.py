"""A provider with an agent and an operator, for tests of what is proposed and approved."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from offered import Provider
from served import document

from aerodaas.protocol.proposals import ApprovalIn, Envelope, ProposalIn
from aerodaas.protocol.schemas import (
    USUAL_SCOPES,
    LinkState,
    MissionOut,
    MissionPhase,
    Role,
    Scope,
    VerdictOut,
)
from aerodaas.service.access.principal import Principal
from aerodaas.service.flights.orders import Outcome
from aerodaas.service.monitor.reports import WatchedVehicle
from aerodaas.service.store import Account, Tenant

PROPOSES = frozenset({Scope.PROPOSE, Scope.SENSE, Scope.COMPUTE})
AGENT = Principal("agent", "farm", Role.PILOT, PROPOSES, "a", agent=True)
OTHER_AGENT = Principal("helper", "farm", Role.PILOT, PROPOSES, "h", agent=True)
STRANGER = Principal("stranger", "city", Role.PILOT, PROPOSES, "s", agent=True)
OPERATOR = Principal("boss", "farm", Role.OPERATOR, frozenset(USUAL_SCOPES), "o")
GOOD = VerdictOut(approved=True, seconds=60.0)


class ProposedTo(Provider):
    """A provider whose rehearsals end as a test says."""

    def __init__(
        self,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
        **settings: Any,  # noqa: ANN401
    ) -> None:
        super().__init__(folder, monkeypatch, watched=False, rehearse=True, **settings)
        self.store.tenants.add(Tenant("city"))
        for one in (AGENT, OTHER_AGENT, STRANGER, OPERATOR):
            self.store.accounts.add(Account(one.account, one.tenant, one.role, one.scopes, 0.0))
        self.charge(0.9)

    def charge(self, battery: float, wind: float | None = None) -> None:
        """Have drone `one` report its charge, and the wind."""
        report = WatchedVehicle(link=LinkState.CONNECTED, heard=1.0, battery=battery, wind=wind)
        self.registry.record_reports({"one": report})

    def propose(
        self, *places: tuple[float, float], by: Principal = AGENT, minutes: float = 15.0
    ) -> MissionOut:
        """Propose a mission of drone `one`."""
        content = {"document": document("one", *(places or ((5, 0),))), "minutes": minutes}
        return self.missions.proposals.propose(by, ProposalIn.model_validate(content))

    def rehearsed(
        self, *places: tuple[float, float], verdict: VerdictOut = GOOD, by: Principal = AGENT
    ) -> MissionOut:
        """Propose a mission, and have its rehearsal end so."""
        return self.rehearse_again(self.propose(*places, by=by).id, verdict=verdict, by=by)

    def rehearse_again(
        self, mission: str, *, verdict: VerdictOut = GOOD, by: Principal = AGENT
    ) -> MissionOut:
        """Have a rehearsal of a proposal end so."""
        self.missions.proposals.rehearse(by, mission, 3)
        self.turns(1)
        self.started[-1].end(Outcome(landed=True, began=0.0, ended=1.0, verdict=verdict))
        self.turns(1)
        return self.missions.mission(by, mission)

    def requested(self, *places: tuple[float, float]) -> MissionOut:
        """Propose a mission, and request its approval after a good rehearsal."""
        found = self.rehearsed(*places)
        return self.missions.proposals.request_approval(AGENT, found.id)

    def approve(
        self,
        mission: MissionOut,
        *,
        by: Principal = OPERATOR,
        envelope: Envelope | None = None,
        actuators: Sequence[str] = (),
    ) -> MissionOut:
        """Approve exactly what was shown."""
        assert mission.proposal is not None
        approval = ApprovalIn(
            hash=mission.proposal.hash, envelope=envelope, actuators=list(actuators)
        )
        return self.missions.approve(by, mission.id, approval)

    def is_flying(self, mission: MissionOut) -> bool:
        """Whether it flies after some turns of the service."""
        self.turns()
        return self.phase(mission) is MissionPhase.FLYING
