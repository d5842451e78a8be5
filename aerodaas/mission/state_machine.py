"""The mission's finite-state machine: states and permitted transitions."""

from __future__ import annotations

from types import MappingProxyType

from aerodaas.errors import MissionError
from aerodaas.messages.mission import MissionState

__all__ = ["FLYING", "TERMINAL", "TRANSITIONS", "MissionStateMachine"]

S = MissionState

FLYING = frozenset({S.HOLDING, S.ENROUTE, S.LOITERING, S.FOLLOWING, S.DIVERTED})
"""States in which navigation is executed."""

_LEAVE = frozenset({S.RETURNING, S.LANDING, S.ABORTED})
_INTERRUPT = _LEAVE | {S.PAUSED}

TRANSITIONS = MappingProxyType(
    {
        S.IDLE: frozenset({S.PREFLIGHT, S.ABORTED}),
        S.PREFLIGHT: frozenset({S.TAKING_OFF, S.ABORTED}),
        S.TAKING_OFF: frozenset({S.HOLDING}) | _LEAVE,
        S.HOLDING: frozenset({S.ENROUTE, S.FOLLOWING, S.DIVERTED}) | _INTERRUPT,
        S.ENROUTE: frozenset({S.HOLDING, S.LOITERING, S.FOLLOWING, S.DIVERTED}) | _INTERRUPT,
        S.LOITERING: frozenset({S.HOLDING, S.ENROUTE, S.FOLLOWING, S.DIVERTED}) | _INTERRUPT,
        S.FOLLOWING: frozenset({S.HOLDING, S.ENROUTE, S.DIVERTED}) | _INTERRUPT,
        S.DIVERTED: frozenset({S.HOLDING, S.ENROUTE, S.LOITERING, S.FOLLOWING}) | _INTERRUPT,
        S.PAUSED: frozenset({S.HOLDING}) | _LEAVE,
        S.RETURNING: frozenset({S.LANDING, S.LANDED, S.ABORTED}),
        S.LANDING: frozenset({S.LANDED, S.ABORTED}),
        S.LANDED: frozenset[MissionState](),
        S.ABORTED: frozenset[MissionState](),
    }
)
"""The states that may follow each state."""

TERMINAL = frozenset(state for state, following in TRANSITIONS.items() if not following)
"""States that end the mission."""


class MissionStateMachine:
    """The current state, and the reason for it."""

    def __init__(self) -> None:
        """Start idle."""
        self.state = MissionState.IDLE
        self.reason = ""
        self.since = 0
        """Mission clock of the last change, nanoseconds."""

    def to(self, state: MissionState, now: int, reason: str = "") -> bool:
        """Change to `state`.

        Args:
            state: The new state, or the current one.
            now: Mission clock, nanoseconds.
            reason: Why; a reason for the current state replaces the old one.

        Returns:
            False if the mission is in the state already.

        Raises:
            MissionError: If the transition is not in TRANSITIONS.
        """
        if state is self.state:
            self.reason = reason or self.reason
            return False
        if state not in TRANSITIONS[self.state]:
            message = f"a mission that is {self.state.value} cannot become {state.value}"
            raise MissionError(message)
        self.state, self.reason, self.since = state, reason, now
        return True
