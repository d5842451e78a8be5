"""A provider with an agent and an operator, for tests of what is proposed and approved."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import pytest
from offered import Link, Provider
from robot_statuses import robot_status
from served import document

from aerodaas.clock import host_time_ns, seconds
from aerodaas.messages.mission import MissionState
from aerodaas.mission.commands import Answer
from aerodaas.protocol.proposals import ApprovalIn, ChangeIn, Envelope, ProposalIn
from aerodaas.protocol.schemas import (
    USUAL_SCOPES,
    LinkState,
    MissionOut,
    MissionPhase,
    NavigationIn,
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


AREA = [(-5.0, -5.0), (20.0, -5.0), (20.0, 20.0), (-5.0, 20.0)]
ENVELOPE = Envelope(area=AREA, floor=1.0, ceiling=8.0, minutes=5.0)


class Flight(Link):
    """The link to a flight of drone `one`, which obeys."""

    def __init__(self) -> None:
        super().__init__()
        self.answer = Answer(accepted=True)
        self.is_at((5.0, 0.0, 2.0))

    def is_at(
        self,
        place: tuple[float, float, float],
        state: MissionState = MissionState.ENROUTE,
        *,
        time: float = 60.0,
        battery: float = 0.9,
    ) -> None:
        """Tell that the drone is there, so many seconds after its take-off."""
        status = robot_status(time, state, battery=battery, position=place)
        told = {"one": seconds(host_time_ns())}
        self.mission = self.mission.model_copy(update={"status": {"one": status}, "told": told})

    def fly(self, command: NavigationIn, *, operator: bool) -> Answer:
        """Answer as a test says."""
        assert not operator, "the flight obeys an operator also after the end of its lease"
        self.asked.append(command)
        return self.answer


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

    def flown(self, envelope: Envelope | None = ENVELOPE) -> tuple[MissionOut, Flight]:
        """A mission of the agent's that flies, changes within `envelope` being approved."""
        mission = self.approve(self.requested(), envelope=envelope)
        assert self.is_flying(mission)
        flight = Flight()
        self.missions._missions[mission.id].link = cast("Any", flight)
        self.turns(1)
        return mission, flight

    def change(
        self, mission: MissionOut, *places: tuple[float, float, float], by: Principal = AGENT
    ) -> MissionOut:
        """Propose these places in the place of drone `one`'s."""
        waypoints = [
            {"id": f"new{n}", "x": x, "y": y, "z": z, "waypoint_type": "local"}
            for n, (x, y, z) in enumerate(places)
        ]
        change = ChangeIn.model_validate({"robot": "one", "waypoints": waypoints})
        return self.missions.proposals.change(by, mission.id, change)

    def judged(self, change: MissionOut, verdict: VerdictOut = GOOD) -> MissionOut:
        """A change after its rehearsal has ended so."""
        self.turns(1)
        self.started[-1].end(Outcome(landed=True, began=0.0, ended=1.0, verdict=verdict))
        self.turns(1)
        return self.missions.mission(OPERATOR, change.id)

    def is_flying(self, mission: MissionOut) -> bool:
        """Whether it flies after some turns of the service."""
        self.turns()
        return self.phase(mission) is MissionPhase.FLYING
