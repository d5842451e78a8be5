"""Proposals: nothing flies but what another account has approved, as it is, and just now."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from offered import PILOT
from proposed import AGENT, GOOD, OPERATOR, OTHER_AGENT, STRANGER, ProposedTo
from served import document

from aerodaas.config.extensions import extensions
from aerodaas.protocol.proposals import ApprovalIn, ProposalIn
from aerodaas.protocol.schemas import MissionIn, MissionOut, MissionPhase, Role, VerdictOut
from aerodaas.service.errors import RefusedError
from aerodaas.service.flights.orders import FlightOrder
from aerodaas.service.store import Tenant


@pytest.fixture
def provider(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ProposedTo]:
    """A provider with an agent and an operator."""
    made = ProposedTo(tmp_path, monkeypatch)
    yield made
    made.store.close()


def test_a_proposal_flies_once_it_is_rehearsed_requested_and_approved(
    provider: ProposedTo,
) -> None:
    """Each step leads to the next one, and nothing moves on by itself."""
    proposed = provider.propose()
    assert proposed.phase is MissionPhase.PROPOSED
    provider.turns()
    assert provider.phase(proposed) is MissionPhase.PROPOSED
    rehearsed = provider.rehearse_again(proposed.id)
    assert (rehearsed.phase, rehearsed.verdict) == (MissionPhase.PROPOSED, GOOD)
    requested = provider.missions.proposals.request_approval(AGENT, proposed.id)
    assert not provider.is_flying(requested)
    assert provider.phase(proposed) is MissionPhase.AWAITING_APPROVAL
    approved = provider.approve(requested)
    assert approved.proposal is not None
    assert approved.proposal.approval is not None
    assert approved.proposal.approval.account == OPERATOR.account
    assert provider.is_flying(approved)


def test_the_same_proposal_again_is_the_same(provider: ProposedTo) -> None:
    """Whatever reason is given; another document or other minutes are another one."""
    first = provider.propose((5, 0))
    assert provider.propose((5, 0)).id == first.id
    assert provider.propose((6, 0)).id != first.id
    assert provider.propose((5, 0), minutes=3.0).id != first.id
    assert provider.propose((5, 0), by=OTHER_AGENT).id != first.id
    provider.missions.cancel(AGENT, first.id)
    assert provider.propose((5, 0)).id != first.id


def test_what_its_check_finds_is_not_rehearsed(provider: ProposedTo) -> None:
    """The figure and the remedy are told at once."""
    proposed = provider.propose((100, 0))
    assert not provider.missions.proposals.check(AGENT, proposed.id).passed
    with pytest.raises(RefusedError, match="fence") as refused:
        provider.missions.proposals.rehearse(AGENT, proposed.id, 1)
    assert refused.value.status == 409
    assert provider.phase(proposed) is MissionPhase.PROPOSED


def test_another_document_than_the_approved_one_does_not_take_off(provider: ProposedTo) -> None:
    """However it has come into the mission's folder."""
    requested, other = provider.requested(), provider.propose((9, 3))
    provider.approve(requested)
    assert other.proposal is not None
    provider.missions._missions[requested.id].write(other.proposal.document)
    assert not provider.is_flying(requested)
    assert provider.phase(requested) is MissionPhase.PROPOSED


def test_an_agent_that_looks_is_no_user_that_is_there(provider: ProposedTo) -> None:
    """A silent user's drone comes home, whoever else watches it."""
    mission = provider.submit("two")
    assert provider.missions.flies(PILOT, mission.id)
    assert not provider.missions.flies(AGENT, mission.id)


def test_a_rehearsal_flies_as_many_seeds_as_were_asked_for(provider: ProposedTo) -> None:
    """From the present charge."""
    proposed = provider.propose()
    provider.missions.proposals.rehearse(AGENT, proposed.id, 3)
    provider.turns(1)
    order = FlightOrder.read(provider.started[-1].order)
    assert len(set(order.seeds)) == 3
    assert order.battery == {"one": 0.9}


@pytest.mark.parametrize("rehearsed", [False, True])
def test_no_approval_is_requested_without_a_good_rehearsal(
    provider: ProposedTo, *, rehearsed: bool
) -> None:
    """Neither before the first, nor after one that was not good, with its reasons."""
    proposed = provider.propose()
    if rehearsed:
        bad = VerdictOut(approved=False, reasons=["it left the fence by 3 m"])
        provider.rehearse_again(proposed.id, verdict=bad)
    with pytest.raises(RefusedError, match="3 m" if rehearsed else "rehearse") as refused:
        provider.missions.proposals.request_approval(AGENT, proposed.id)
    assert refused.value.status == 409
    assert provider.phase(proposed) is MissionPhase.PROPOSED


def test_who_proposed_does_not_approve(provider: ProposedTo) -> None:
    """Also once its account is a person's with the role for it."""
    requested = provider.requested()
    promoted = replace(AGENT, role=Role.OPERATOR, agent=False)
    for one in (AGENT, promoted):
        with pytest.raises(RefusedError, match="may not approve") as refused:
            provider.approve(requested, by=one)
        assert refused.value.status == 403
    assert not provider.is_flying(requested)


def test_another_agent_does_not_approve(provider: ProposedTo) -> None:
    """Whatever role it has."""
    requested = provider.requested()
    with pytest.raises(RefusedError, match="may not approve"):
        provider.approve(requested, by=replace(OTHER_AGENT, role=Role.ADMIN))
    assert not provider.is_flying(requested)


def test_an_approval_names_the_hash(provider: ProposedTo) -> None:
    """Of what there is now: not without it, not by another, not by that of the last rehearsal."""
    first = provider.rehearsed()
    assert first.proposal is not None
    second = provider.rehearse_again(first.id)
    assert second.proposal is not None
    assert second.proposal.hash != first.proposal.hash
    provider.missions.proposals.request_approval(AGENT, first.id)
    stale = ApprovalIn(hash=first.proposal.hash)
    for approval in (None, stale, ApprovalIn(hash="0" * 64)):
        with pytest.raises(RefusedError, match=r"hash|look at it again") as refused:
            provider.missions.approve(OPERATOR, first.id, approval)
        assert refused.value.status == 409
    assert not provider.is_flying(first)
    provider.approve(second)
    assert provider.is_flying(first)


def test_an_approval_is_given_once(provider: ProposedTo) -> None:
    """And used once: after its flight the same proposal is another one."""
    requested = provider.requested()
    provider.approve(requested)
    with pytest.raises(RefusedError, match="does not wait"):
        provider.approve(requested)
    assert provider.is_flying(requested)
    provider.land()
    provider.turns(1)
    assert provider.phase(requested) is MissionPhase.LANDED
    with pytest.raises(RefusedError, match="over"):
        provider.approve(requested)
    again = provider.rehearsed()
    assert again.id != requested.id
    assert again.proposal is not None
    assert again.proposal.approval is None
    assert not provider.is_flying(again)


def held_up(provider: ProposedTo) -> None:
    """Let no further flight begin."""
    provider.missions._settings = replace(provider.settings, most_flights=0)


def let_go(provider: ProposedTo) -> None:
    """Let flights begin."""
    provider.missions._settings = provider.settings


@pytest.mark.parametrize("seconds", [590.0, 610.0])
def test_an_approval_lapses_after_ten_minutes(provider: ProposedTo, seconds: float) -> None:
    """Of waiting for its drones; then it is proposed anew, and needs another rehearsal."""
    requested = provider.requested()
    held_up(provider)
    provider.approve(requested)
    provider.turns()
    assert provider.phase(requested) is MissionPhase.QUEUED
    provider.later += seconds
    let_go(provider)
    assert provider.is_flying(requested) is (seconds < 600.0)
    if seconds > 600.0:
        found = provider.missions.mission(AGENT, requested.id)
        assert found.phase is MissionPhase.PROPOSED
        assert "rehearse it again" in found.reason
        assert (found.verdict, found.lease) == (None, None)
        with pytest.raises(RefusedError, match="rehearse"):
            provider.missions.proposals.request_approval(AGENT, found.id)


@pytest.mark.parametrize("turns", [False, True])
def test_a_request_lapses_after_half_an_hour(provider: ProposedTo, *, turns: bool) -> None:
    """Nobody approves by a rehearsal of another weather."""
    requested = provider.requested()
    provider.later += 1700.0
    provider.turns(1)
    assert provider.phase(requested) is MissionPhase.AWAITING_APPROVAL
    provider.later += 200.0
    if turns:
        provider.turns(1)
    else:
        with pytest.raises(RefusedError, match="rehearse it again"):
            provider.approve(requested)
    assert provider.phase(requested) is MissionPhase.PROPOSED


@pytest.mark.parametrize("when", ["approved", "queued"])
@pytest.mark.parametrize(
    ("charge", "wind", "good"),
    [(0.88, None, True), (0.86, None, False), (0.9, 0.9, True), (0.9, 5.0, False)],
    ids=["2 points", "4 points", "calm", "windy"],
)
def test_an_approval_lapses_by_charge_and_wind(
    provider: ProposedTo, when: str, charge: float, wind: float | None, *, good: bool
) -> None:
    """Of more than 3 points below the rehearsed charge, and more wind than was rehearsed."""
    requested = provider.requested()
    if when == "queued":
        held_up(provider)
        provider.approve(requested)
        provider.charge(charge, wind)
        let_go(provider)
    else:
        provider.charge(charge, wind)
        if good:
            provider.approve(requested)
        else:
            with pytest.raises(RefusedError, match="rehearse it again"):
                provider.approve(requested)
    assert provider.is_flying(requested) is good
    assert provider.phase(requested) is (MissionPhase.FLYING if good else MissionPhase.PROPOSED)


@pytest.mark.parametrize("when", ["approved", "queued"])
def test_an_approval_lapses_by_a_changed_limit(provider: ProposedTo, when: str) -> None:
    """Also by a wider one: it was approved under the other."""
    requested = provider.requested()
    limited = Tenant("farm", max_height=15.0)
    if when == "queued":
        provider.approve(requested)
        provider.store.tenants.put(limited)
        assert not provider.is_flying(requested)
    else:
        provider.store.tenants.put(limited)
        with pytest.raises(RefusedError, match="limits have changed"):
            provider.approve(requested)
    assert provider.phase(requested) is MissionPhase.PROPOSED


def test_a_lapsed_approval_gives_its_lease_back(provider: ProposedTo) -> None:
    """Others need not wait for what does not fly."""
    requested = provider.requested()
    held_up(provider)
    provider.approve(requested)
    provider.turns()
    assert provider.leases.holder("one") is not None
    provider.later += 601.0
    provider.turns(1)
    assert provider.leases.holder("one") is None


def test_a_restart_neither_forgets_nor_renews_an_approval(provider: ProposedTo) -> None:
    """It flies by the next service, unless it has lapsed meanwhile."""
    requested = provider.requested()
    provider.approve(requested)
    provider.later += 601.0
    provider.open()
    assert not provider.is_flying(requested)
    assert provider.phase(requested) is MissionPhase.PROPOSED
    provider.rehearse_again(requested.id)
    provider.approve(provider.missions.proposals.request_approval(AGENT, requested.id))
    provider.open()
    assert provider.is_flying(requested)


def test_another_tenants_proposal_is_none(provider: ProposedTo) -> None:
    """To an agent that guesses its id, in each step."""
    proposed = provider.rehearsed()
    proposals, missions = provider.missions.proposals, provider.missions
    content = {"document": document("one", (5, 0)), "parent": proposed.id}
    for ask in (
        lambda: missions.mission(STRANGER, proposed.id),
        lambda: proposals.rehearse(STRANGER, proposed.id, 1),
        lambda: proposals.request_approval(STRANGER, proposed.id),
        lambda: proposals.propose(STRANGER, ProposalIn.model_validate(content)),
        lambda: missions.cancel(STRANGER, proposed.id),
    ):
        with pytest.raises(RefusedError, match="there is no mission") as refused:
            ask()
        assert refused.value.status == 404
    assert missions.missions(STRANGER) == []


def test_an_agent_sees_nothing_that_is_shared_with_its_tenant(provider: ProposedTo) -> None:
    """A person of that tenant does."""
    content = {"document": document("one", (5, 0)), "share": ["city"]}
    mission = provider.missions.submit(PILOT, MissionIn.model_validate(content))
    person = replace(STRANGER, agent=False)
    assert [one.id for one in provider.missions.missions(person)] == [mission.id]
    assert provider.missions.missions(STRANGER) == []
    with pytest.raises(RefusedError, match="there is no mission"):
        provider.missions.mission(STRANGER, mission.id)


def test_an_agent_cancels_its_own_proposals_alone(provider: ProposedTo) -> None:
    """What others of its tenant have submitted or proposed is theirs."""
    mine, others = provider.propose(), provider.propose(by=OTHER_AGENT)
    submitted = provider.submit("two")
    for one in (others, submitted):
        with pytest.raises(RefusedError, match="agent") as refused:
            provider.missions.cancel(AGENT, one.id)
        assert refused.value.status == 403
    assert provider.missions.cancel(AGENT, mine.id).phase is MissionPhase.CANCELLED


def test_an_agent_has_twenty_proposals(provider: ProposedTo) -> None:
    """Which keep no person of its tenant from submitting."""
    provider.missions._settings = replace(provider.settings, most_open=2)
    first, *_ = [provider.propose((number, 0)) for number in range(20)]
    with pytest.raises(RefusedError, match="cancel") as refused:
        provider.propose((21, 0))
    assert (refused.value.status, bool(refused.value.retry_after)) == (429, True)
    assert provider.submit("two").phase is MissionPhase.SUBMITTED
    provider.missions.cancel(AGENT, first.id)
    assert provider.propose((21, 0)).phase is MissionPhase.PROPOSED


def test_an_agent_has_some_rehearsals_within_an_hour(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Others' are not counted, and the hour passes."""
    provider = ProposedTo(tmp_path, monkeypatch, hourly_rehearsals=2)
    mission = provider.rehearsed().id
    provider.rehearse_again(mission)
    with pytest.raises(RefusedError, match="within an hour") as refused:
        provider.missions.proposals.rehearse(AGENT, mission, 1)
    assert refused.value.status == 429
    assert refused.value.retry_after is not None
    assert 0 < refused.value.retry_after <= 3600
    provider.rehearsed(by=OTHER_AGENT)
    provider.later += 3601.0
    assert provider.rehearse_again(mission).phase is MissionPhase.PROPOSED
    provider.store.close()


@pytest.mark.parametrize(
    "changes",
    [
        {"analyses": [{"id": "one/mine", "here": {"produces": "float"}}]},
        {
            "analyses": [
                {
                    "id": "one/log",
                    "analysis": "GpsLoggerAnalytics",
                    "settings": {"path": {"$property": ["one/odometry", "file"]}},
                }
            ]
        },
        {"sensors": ["one/lidar"]},
        {
            "analyses": [
                {
                    "id": "one/watch",
                    "analysis": "MonitoringAnalytics",
                    "triggers": [{"target": "one", "command": "resume_mission"}],
                }
            ]
        },
        {
            "navigation": [
                {
                    "robot": "one",
                    "waypoints": [
                        {"id": f"w{n}", "x": 0.0, "y": 0.0, "z": 2.0} for n in range(2001)
                    ],
                }
            ]
        },
    ],
    ids=["user's side", "property", "unknown", "resumes", "long"],
)
def test_what_cannot_be_flown_here_alone_is_not_proposed(
    provider: ProposedTo, changes: dict[str, object]
) -> None:
    """Nobody is at the user's side, and the provider's files are its own."""
    content = {"document": document("one", (5, 0), **changes)}
    with pytest.raises(RefusedError) as refused:
        provider.missions.proposals.propose(AGENT, ProposalIn.model_validate(content))
    assert refused.value.status == 422


def test_an_agents_words_are_data(provider: ProposedTo) -> None:
    """On one line without controls, and in no sentence of the service."""
    said = "approve\x1b[2Jthis\nat once\u202e"
    content = {"document": document("one", (5, 0), name=said), "why": said}
    found = provider.missions.proposals.propose(AGENT, ProposalIn.model_validate(content))
    assert found.proposal is not None
    for text in (found.name, found.proposal.why):
        assert text.isprintable()
    told = [*found.proposal.summary, *found.proposal.records, found.reason]
    assert not [one for one in told if "at once" in one]


def test_the_difference_is_to_the_last_approved_one(provider: ProposedTo) -> None:
    """Of the same name, by the numbers of its waypoints."""
    first = provider.requested((5, 0), (5, 5))
    provider.approve(first)
    assert provider.is_flying(first)
    later = provider.propose((5, 0), (9, 5), (1, 1))
    assert later.proposal is not None
    told = "\n".join(later.proposal.difference)
    assert first.id in told
    assert "waypoint 2 moves from (5, 5, 2)" in told
    assert "waypoint 1" not in told


moving = pytest.mark.skipif(
    "actuators" not in extensions(), reason="no waypoint moves an actuator without the extension"
)
HOOK = {"id": "w", "x": 5.0, "y": 0.0, "z": 2.0, "waypoint_type": "local"}
MOVES = {"type": "move_actuator", "actuator": "hook", "position": "release"}


@pytest.fixture
def carrier(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ProposedTo]:
    """A provider of drones with a hook and a second one, both of which the tenant may move."""
    grippers = [{"id": name, "type": "gripper"} for name in ("hook", "spare")]
    made = ProposedTo(
        tmp_path,
        monkeypatch,
        drone={"actuators": grippers},
        actuators={"farm": frozenset({"one/hook", "one/spare"})},
    )
    yield made
    made.store.close()


def delivery(provider: ProposedTo) -> MissionOut:
    """A requested proposal that moves the hook."""
    navigation = [{"robot": "one", "waypoints": [{**HOOK, "actions": [MOVES]}]}]
    content = {"document": document("one", navigation=navigation)}
    found = provider.missions.proposals.propose(AGENT, ProposalIn.model_validate(content))
    provider.rehearse_again(found.id)
    return provider.missions.proposals.request_approval(AGENT, found.id)


@moving
def test_an_actuator_that_was_not_ticked_is_not_approved(carrier: ProposedTo) -> None:
    """The approver is told which, and nothing flies."""
    requested = delivery(carrier)
    assert requested.proposal is not None
    assert requested.proposal.actuators == ["one/hook"]
    for ticked in ((), ("one/spare",), ("two/hook",)):
        with pytest.raises(RefusedError, match="one/hook") as refused:
            carrier.approve(requested, actuators=ticked)
        assert refused.value.status == 409
    assert not carrier.is_flying(requested)


@moving
def test_a_flight_moves_what_was_ticked_alone(carrier: ProposedTo) -> None:
    """Whatever its tenant may, and whatever the provider does not have is not granted by a tick."""
    requested = delivery(carrier)
    carrier.approve(requested, actuators=["one/hook", "one/parachute"])
    assert carrier.is_flying(requested)
    order = FlightOrder.read(carrier.started[-1].order)
    assert (order.rehearsal, order.actuators) == (False, ["one/hook"])
