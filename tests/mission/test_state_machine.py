"""The mission's states: what may follow what, since when, and why."""

from __future__ import annotations

import pytest

from aerodaas.errors import MissionError
from aerodaas.messages.mission import MissionState
from aerodaas.mission.state_machine import TERMINAL, TRANSITIONS, MissionStateMachine


def test_a_change_is_dated_and_has_its_reason() -> None:
    """The same state again keeps its date, and its reason unless there is a new one."""
    machine = MissionStateMachine()
    assert (machine.state, machine.reason, machine.since) == (MissionState.IDLE, "", 0)
    assert machine.to(MissionState.PREFLIGHT, 5, "not ready") is True
    assert machine.to(MissionState.PREFLIGHT, 7) is False
    assert (machine.reason, machine.since) == ("not ready", 5)
    assert machine.to(MissionState.PREFLIGHT, 9, "no GPS") is False
    assert (machine.reason, machine.since) == ("no GPS", 5)
    assert machine.to(MissionState.TAKING_OFF, 11) is True
    assert (machine.reason, machine.since) == ("", 11)


@pytest.mark.parametrize("state", MissionState)
def test_only_what_is_listed_may_follow(state: MissionState) -> None:
    """Anything else is refused, and the state stays as it was."""
    for following in set(MissionState) - TRANSITIONS[state] - {state}:
        machine = MissionStateMachine()
        machine.state = state
        with pytest.raises(MissionError, match=f"{state.value} cannot become {following.value}"):
            machine.to(following, 1)
        assert machine.state is state


def test_every_state_is_reachable() -> None:
    """Thirteen states, each reached from IDLE."""
    reached, waiting = set[MissionState](), [MissionState.IDLE]
    while waiting:
        state = waiting.pop()
        if state not in reached:
            reached.add(state)
            waiting.extend(TRANSITIONS[state])
    assert reached == set(MissionState)
    assert len(reached) == 13
    assert {MissionState.LANDED, MissionState.ABORTED} == TERMINAL
