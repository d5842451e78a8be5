"""Changes of missions in flight: done within what was approved beforehand, or asked for anew."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from proposed import AGENT, AREA, ENVELOPE, GOOD, OPERATOR, OTHER_AGENT, STRANGER, ProposedTo

from aerodaas.config.extensions import extensions
from aerodaas.messages.mission import MissionState
from aerodaas.mission.commands import Answer
from aerodaas.protocol.proposals import ApprovalIn, ChangeIn
from aerodaas.protocol.schemas import MissionPhase, NavigationIn, VerdictOut
from aerodaas.service.errors import RefusedError


@pytest.fixture
def provider(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ProposedTo]:
    """A provider with an agent and an operator."""
    made = ProposedTo(tmp_path, monkeypatch)
    yield made
    made.store.close()


def test_a_change_within_the_envelope_is_applied_after_its_rehearsal(provider: ProposedTo) -> None:
    """Not before: from where the drone is, in the place of all that it had ahead."""
    mission, flight = provider.flown()
    change = provider.change(mission, (10, 10, 3))
    provider.turns(1)
    assert (provider.phase(change), flight.asked) == (MissionPhase.REHEARSING, [])
    assert change.proposal is not None
    assert change.proposal.change_of == mission.id
    first, second = change.proposal.document.navigation[0].waypoints
    assert (first.x, first.y, first.z) == (5.0, 0.0, 2.0)
    assert provider.judged(change).phase is MissionPhase.APPLIED
    (given,) = flight.asked
    assert isinstance(given, NavigationIn)
    assert (given.waypoints, given.clear_first) == ([second], True)
    assert provider.phase(mission) is MissionPhase.FLYING


@pytest.mark.parametrize(
    ("place", "minutes", "inside"),
    [
        ((19.0, 19.0, 7.0), 3.9, True),
        ((21.0, 5.0, 3.0), 1.0, False),
        ((5.0, 5.0, 8.5), 1.0, False),
        ((5.0, 5.0, 0.5), 1.0, False),
        ((5.0, 5.0, 3.0), 4.1, False),
    ],
    ids=["inside", "area", "ceiling", "floor", "minutes"],
)
def test_a_change_outside_of_the_envelope_is_asked_for(
    provider: ProposedTo, place: tuple[float, float, float], minutes: float, *, inside: bool
) -> None:
    """By each of its bounds; the minutes count from the take-off, a minute ago."""
    mission, flight = provider.flown()
    verdict = VerdictOut(approved=True, seconds=60.0 * minutes)
    found = provider.judged(provider.change(mission, place), verdict)
    assert bool(flight.asked) is inside
    wanted = MissionPhase.APPLIED if inside else MissionPhase.AWAITING_APPROVAL
    assert found.phase is wanted


def test_an_area_that_crosses_itself_is_no_envelope(provider: ProposedTo) -> None:
    """Nobody knows what lies inside."""
    crossing = [AREA[0], AREA[2], AREA[1], AREA[3]]
    requested = provider.requested()
    with pytest.raises(RefusedError, match="area") as refused:
        provider.approve(requested, envelope=ENVELOPE.model_copy(update={"area": crossing}))
    assert refused.value.status == 422
    assert provider.phase(requested) is MissionPhase.AWAITING_APPROVAL


def test_a_leg_that_leaves_the_envelope_is_asked_for(provider: ProposedTo) -> None:
    """Although both its ends lie inside: also the first leg, from where the drone is."""
    notch = [*AREA[:3], (8.0, 20.0), (8.0, 2.0), (2.0, 2.0), (2.0, 20.0), AREA[3]]
    mission, flight = provider.flown(ENVELOPE.model_copy(update={"area": notch}))
    flight.is_at((0.0, 10.0, 3.0))
    found = provider.judged(provider.change(mission, (10, 10, 3)))
    assert (found.phase, flight.asked) == (MissionPhase.AWAITING_APPROVAL, [])


def test_without_an_envelope_each_change_is_asked_for(provider: ProposedTo) -> None:
    """Its approval applies it, by hash as any other, and never its proposer's own."""
    mission, flight = provider.flown(None)
    found = provider.judged(provider.change(mission, (5, 5, 3)))
    assert found.phase is MissionPhase.AWAITING_APPROVAL
    with pytest.raises(RefusedError, match="may not approve"):
        provider.approve(found, by=AGENT)
    with pytest.raises(RefusedError, match="look at it again"):
        provider.missions.approve(OPERATOR, found.id, ApprovalIn(hash="0" * 64))
    assert flight.asked == []
    assert provider.approve(found).phase is MissionPhase.APPLIED
    assert len(flight.asked) == 1
    with pytest.raises(RefusedError, match="over"):
        provider.approve(found)


def test_a_change_whose_rehearsal_was_not_good_is_refused(provider: ProposedTo) -> None:
    """Whatever envelope it lies in."""
    mission, flight = provider.flown()
    bad = VerdictOut(approved=False, reasons=["it came to 0.4 m from a tree"], seconds=1.0)
    found = provider.judged(provider.change(mission, (5, 5, 3)), bad)
    assert (found.phase, flight.asked) == (MissionPhase.REFUSED, [])
    assert "0.4 m" in found.reason


def test_a_change_of_a_mission_that_is_over_is_cancelled(provider: ProposedTo) -> None:
    """Whether it is being rehearsed or waits for its approval."""
    mission, flight = provider.flown(None)
    own = provider.started[-1]
    waiting = provider.judged(provider.change(mission, (5, 5, 3)))
    rehearsing = provider.change(mission, (6, 6, 3))
    provider.started.append(own)
    provider.land()
    provider.turns(2)
    for change in (waiting, rehearsing):
        found = provider.missions.shown(change.id)
        assert (found.phase, mission.id in found.reason) == (MissionPhase.CANCELLED, True)
    with pytest.raises(RefusedError, match="over"):
        provider.approve(waiting)
    assert flight.asked == []


@pytest.mark.parametrize(
    "state", [MissionState.PAUSED, MissionState.RETURNING, MissionState.LANDING]
)
def test_a_drone_that_was_stopped_is_not_changed(provider: ProposedTo, state: MissionState) -> None:
    """Neither when it is asked for, nor after its rehearsal: a person has stopped it meanwhile."""
    mission, flight = provider.flown()
    change = provider.change(mission, (5, 5, 3))
    provider.turns(1)
    flight.is_at((5, 0, 2), state)
    assert provider.judged(change).phase is MissionPhase.REFUSED
    assert flight.asked == []
    with pytest.raises(RefusedError, match=state.value) as refused:
        provider.change(mission, (6, 6, 3))
    assert refused.value.status == 409


def test_a_change_is_checked_again_from_where_the_drone_is_by_then(provider: ProposedTo) -> None:
    """It has flown on while it waited for the approval, here to where it must not be."""
    mission, flight = provider.flown(None)
    found = provider.judged(provider.change(mission, (5, 5, 3)))
    flight.is_at((100.0, 0.0, 2.0))
    assert provider.approve(found).phase is MissionPhase.REFUSED
    assert flight.asked == []


def test_what_the_drone_refuses_is_not_applied(provider: ProposedTo) -> None:
    """The drone's own word counts."""
    mission, flight = provider.flown()
    flight.answer = Answer(accepted=False, text="the drone is returning by now")
    found = provider.judged(provider.change(mission, (5, 5, 3)))
    assert (found.phase, "returning" in found.reason) == (MissionPhase.REFUSED, True)


def test_waypoints_that_the_drone_refuses_are_told(provider: ProposedTo) -> None:
    """It flies the others."""
    mission, flight = provider.flown()
    flight.answer = Answer(accepted=True, refused={"new1": "outside the fence"})
    found = provider.judged(provider.change(mission, (5, 5, 3), (6, 6, 3)))
    assert (found.phase, "without 1" in found.reason) == (MissionPhase.APPLIED, True)


def test_only_its_proposer_changes_a_mission(provider: ProposedTo) -> None:
    """Another agent of the tenant is refused, and to a stranger there is none."""
    mission, _ = provider.flown()
    with pytest.raises(RefusedError, match="propose one of your own"):
        provider.change(mission, (5, 5, 3), by=OTHER_AGENT)
    with pytest.raises(RefusedError, match="there is no mission"):
        provider.change(mission, (5, 5, 3), by=STRANGER)


def test_the_same_change_again_is_the_same(provider: ProposedTo) -> None:
    """Until it is over."""
    mission, _ = provider.flown(None)
    first = provider.change(mission, (5, 5, 3))
    assert provider.change(mission, (5, 5, 3)).id == first.id
    assert provider.change(mission, (6, 5, 3)).id != first.id


@pytest.mark.parametrize(
    "waypoint", [{"waypoint_type": "relative"}, {"waypoint_type": "local", "above": "ground"}]
)
def test_a_changes_places_are_metres_from_home(
    provider: ProposedTo, waypoint: dict[str, object]
) -> None:
    """Those from the take-off or above ground mean another place in a rehearsal."""
    mission, _ = provider.flown()
    content = {"robot": "one", "waypoints": [{"id": "w", "x": 1.0, "y": 1.0, "z": 3.0, **waypoint}]}
    with pytest.raises(RefusedError, match="local") as refused:
        provider.missions.proposals.change(AGENT, mission.id, ChangeIn.model_validate(content))
    assert refused.value.status == 422


def test_a_change_beyond_the_fence_is_refused_by_its_check(provider: ProposedTo) -> None:
    """Before anything is rehearsed or asked."""
    mission, flight = provider.flown()
    begun = len(provider.started)
    with pytest.raises(RefusedError, match="fence") as refused:
        provider.change(mission, (100, 0, 3))
    provider.turns()
    assert (refused.value.status, len(provider.started), flight.asked) == (409, begun, [])


def test_a_change_that_needs_more_charge_than_is_left_is_not_applied(
    provider: ProposedTo,
) -> None:
    """The drone has flown on while it was rehearsed, and while it waited for its approval."""
    mission, flight = provider.flown(None)
    verdict = replace_used(GOOD, 0.5)
    found = provider.judged(provider.change(mission, (5, 5, 3)), verdict)
    assert found.phase is MissionPhase.AWAITING_APPROVAL
    flight.is_at((5, 0, 2), battery=0.85, time=70.0)
    provider.charge(0.85)
    provider.turns(1)
    assert provider.phase(found) is MissionPhase.AWAITING_APPROVAL
    provider.charge(0.5)
    with pytest.raises(RefusedError, match="rehearsed with"):
        provider.approve(found)
    assert flight.asked == []


def replace_used(verdict: VerdictOut, used: float) -> VerdictOut:
    """A verdict on a flight that used so much of a full charge."""
    return verdict.model_copy(update={"battery_used": used})


def test_rehearsals_of_changes_count_as_any_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within an hour."""
    provider = ProposedTo(tmp_path, monkeypatch, hourly_rehearsals=2)
    mission, _ = provider.flown()
    provider.judged(provider.change(mission, (5, 5, 3)))
    with pytest.raises(RefusedError, match="within an hour"):
        provider.change(mission, (6, 6, 3))
    provider.store.close()


@pytest.mark.skipif(
    "actuators" not in extensions(), reason="no waypoint moves an actuator without the extension"
)
def test_a_change_moves_no_actuator_that_was_not_ticked(provider: ProposedTo) -> None:
    """The flight has none, and no change brings it one."""
    mission, flight = provider.flown()
    moves = {"type": "move_actuator", "actuator": "hook", "position": "release"}
    waypoint = {"id": "w", "x": 1.0, "y": 1.0, "z": 3.0, "waypoint_type": "local"}
    content = {"robot": "one", "waypoints": [{**waypoint, "actions": [moves]}]}
    with pytest.raises(RefusedError, match="one/hook") as refused:
        provider.missions.proposals.change(AGENT, mission.id, ChangeIn.model_validate(content))
    assert (refused.value.status, flight.asked) == (403, [])
