"""No take-off without a fresh approval: whatever an agent, a person and the clock do meanwhile."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, event, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from proposed import AGENT, GOOD, OPERATOR, OTHER_AGENT, STRANGER, ProposedTo

from aerodaas.errors import AeroDaaSError
from aerodaas.protocol.proposals import ApprovalIn
from aerodaas.protocol.schemas import MissionOut, MissionPhase, VerdictOut
from aerodaas.service.access.principal import Principal
from aerodaas.service.flights.orders import Outcome
from aerodaas.service.store import Tenant

pytestmark = pytest.mark.slow

PLACES = [(5.0, 0.0), (9.0, 3.0)]
WHO = st.sampled_from([AGENT, OTHER_AGENT, STRANGER, OPERATOR])


class Proposals(RuleBasedStateMachine):
    """Two proposals of one agent, and what others make of them."""

    def __init__(self) -> None:
        super().__init__()
        self.patch = pytest.MonkeyPatch()
        self.folder = tempfile.TemporaryDirectory()
        self.provider = ProposedTo(
            Path(self.folder.name), self.patch, hourly_rehearsals=1000, most_flights=16
        )
        self.hashes: set[str] = set()
        self.given: dict[str, tuple[str, float, float]] = {}
        """Hash, moment and charge of each newest approval that was accepted, by mission."""
        self.flown: set[str] = set()

    def teardown(self) -> None:
        """Leave nothing behind."""
        self.provider.store.close()
        self.patch.undo()
        self.folder.cleanup()

    def _try(self, ask: Callable[[], object]) -> bool:
        try:
            ask()
        except AeroDaaSError:
            return False
        return True

    def _open(self) -> list[MissionOut]:
        missions = self.provider.missions
        shown = [one.id for one in missions.missions(OPERATOR) if not one.phase.over]
        return [missions.mission(OPERATOR, id_) for id_ in shown]

    @rule(place=st.sampled_from(PLACES))
    def propose(self, place: tuple[float, float]) -> None:
        """Propose, or find the same one."""
        proposed = self.provider.propose(place)
        assert proposed.proposal is not None
        self.hashes.add(proposed.proposal.hash)

    @precondition(lambda self: self._open())
    @rule(data=st.data(), who=WHO, good=st.booleans())
    def rehearse(self, data: st.DataObject, who: Principal, *, good: bool) -> None:
        """Rehearse to some end."""
        mission = data.draw(st.sampled_from(self._open())).id
        begun = len(self.provider.started)
        if not self._try(lambda: self.provider.missions.proposals.rehearse(who, mission, 1)):
            return
        assert who is AGENT
        self.turns()
        if len(self.provider.started) > begun:
            verdict = GOOD if good else VerdictOut(approved=False, reasons=["it hit a tree"])
            outcome = Outcome(landed=True, began=0.0, ended=1.0, verdict=verdict)
            self.provider.started[-1].end(outcome)
        self.turns()

    @precondition(lambda self: self._open())
    @rule(data=st.data(), who=WHO)
    def request(self, data: st.DataObject, who: Principal) -> None:
        """Ask for an approval."""
        mission = data.draw(st.sampled_from(self._open()))
        proposals = self.provider.missions.proposals
        if self._try(lambda: proposals.request_approval(who, mission.id)):
            assert who is AGENT
            assert mission.verdict is not None
            assert mission.verdict.approved

    @precondition(lambda self: self._open())
    @rule(data=st.data(), who=st.sampled_from([AGENT, OTHER_AGENT, OPERATOR]), stale=st.booleans())
    def approve(self, data: st.DataObject, who: Principal, *, stale: bool) -> None:
        """Approve by the present hash, or by any that there has been."""
        mission = data.draw(st.sampled_from(self._open()))
        assert mission.proposal is not None
        present = mission.proposal.hash
        self.hashes.add(present)
        chosen = data.draw(st.sampled_from(sorted(self.hashes))) if stale else present
        missions, approval = self.provider.missions, ApprovalIn(hash=chosen)
        if self._try(lambda: missions.approve(who, mission.id, approval)):
            assert who is OPERATOR
            assert chosen == present
            charge = self.provider.registry.states["one"].battery
            assert charge is not None
            self.given[mission.id] = chosen, self.provider.later, charge

    @rule(seconds=st.sampled_from([1.0, 300.0, 590.0, 601.0, 1801.0]))
    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.provider.later += seconds

    @rule(charge=st.sampled_from([0.9, 0.88, 0.85]))
    def discharge(self, charge: float) -> None:
        """Have the drone report another charge."""
        self.provider.charge(charge)

    @rule(height=st.sampled_from([None, 15.0]))
    def limit(self, height: float | None) -> None:
        """Change the tenant's limits."""
        self.provider.store.tenants.put(Tenant("farm", max_height=height))

    @rule()
    def restart(self) -> None:
        """Serve by another process."""
        self.provider.open()

    @rule()
    def land(self) -> None:
        """End the flight under way."""
        flying = [one.id for one in self._open() if one.phase is MissionPhase.FLYING]
        for folder in self.provider.started:
            if folder.path.parent.name in flying and folder.path.name == "f":
                self.provider.started.append(folder)
                self.provider.land(battery=0.9)
                break
        self.turns()

    @rule()
    def turns(self) -> None:
        """Let the service move on."""
        self.provider.turns(2)

    @invariant()
    def each_take_off_was_approved_just_now(self) -> None:
        """By the hash that the proposal has, by somebody else, and for this take-off alone."""
        flights = {one.path.parent.name for one in self.provider.started if one.path.name == "f"}
        for id_ in flights - self.flown:
            mission = self.provider.missions.mission(OPERATOR, id_)
            assert id_ in self.given
            approved, moment, charge = self.given.pop(id_)
            assert mission.proposal is not None
            assert mission.proposal.hash == approved
            assert self.provider.later - moment <= 600.0
            present = self.provider.registry.states["one"].battery
            assert present is not None
            assert charge - present <= 0.03 + 1e-9
            event("it flies")
        self.flown |= flights

    @precondition(lambda self: self._open())
    @rule(data=st.data(), steps=st.integers(1, 5))
    def go_on(self, data: st.DataObject, steps: int) -> None:
        """Take steps towards a flight, as an agent and an operator at their best do."""
        mission = data.draw(st.sampled_from(self._open()))
        for _ in range(steps):
            self._step(self.provider.missions.mission(OPERATOR, mission.id))
            self.turns()

    def _step(self, mission: MissionOut) -> None:
        proposals, missions = self.provider.missions.proposals, self.provider.missions
        assert mission.proposal is not None
        if mission.phase is MissionPhase.AWAITING_APPROVAL:
            approval = ApprovalIn(hash=mission.proposal.hash)
            if self._try(lambda: missions.approve(OPERATOR, mission.id, approval)):
                charge = self.provider.registry.states["one"].battery
                assert charge is not None
                self.given[mission.id] = approval.hash, self.provider.later, charge
        elif mission.phase is MissionPhase.PROPOSED and mission.verdict is None:
            self.provider.rehearse_again(mission.id)
        elif mission.phase is MissionPhase.PROPOSED:
            self._try(lambda: proposals.request_approval(AGENT, mission.id))

    @invariant()
    def one_flight_at_a_time(self) -> None:
        """The other one waits for the drone."""
        assert sum(one.phase is MissionPhase.FLYING for one in self._open()) <= 1


TestProposals = Proposals.TestCase
TestProposals.settings = settings(
    max_examples=30,
    stateful_step_count=25,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
