"""Handover of a mission's waypoints to somebody who flies them without setpoints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from aerodaas.config.extensions import added
from aerodaas.config.sections.robot import RobotConfig
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import VehicleState
from aerodaas.mission.commands import Answer, HandOver, TakeBack
from aerodaas.mission.log import MissionLog
from aerodaas.mission.navigation.queue import QueuedWaypoint
from aerodaas.mission.navigation.route import Route
from aerodaas.mission.safety.ground_clearance import GroundClearance

__all__ = ["HANDED_OVER", "Handover", "HandoverContext", "make_handover"]

HANDED_OVER = frozenset({MissionState.ENROUTE, MissionState.LOITERING, MissionState.DIVERTED})
"""States of a mission that flies by waypoints, from which and in which they are handed over."""


@dataclass(frozen=True, slots=True)
class HandoverContext:
    """The mission to which a handover belongs."""

    vehicle: object
    """The vehicle, of any class."""
    robot: RobotConfig
    route: Route
    """Ways around no-fly zones and the geofence."""
    clearance: GroundClearance | None
    """The height to keep above the ground; None without a terrain."""
    log: MissionLog


class Handover:
    """Handover of one mission's waypoints (`Extension.handovers`), called by it once a turn.

    This base class hands over none. Every method returns at once. The mission takes the waypoints
    back before it does anything else with the vehicle, by a command, a failsafe or the guard.
    """

    def __init__(self, context: HandoverContext) -> None:
        """Prepare for a mission that has not begun."""
        self.context = context

    @property
    def active(self) -> bool:
        """Whether waypoints are handed over, or about to be."""
        return False

    @property
    def flies(self) -> bool:
        """Whether somebody else flies them, so that the mission sends no setpoints."""
        return False

    def handle(
        self,
        command: HandOver | TakeBack,
        mission: MissionState,
        stops: Sequence[QueuedWaypoint],
        state: VehicleState | None,
        now: int,
        ongoing: str = "",
    ) -> Answer:
        """Begin to hand `stops` over, or take them back; the latter takes effect with this turn.

        Args:
            command: What is asked for.
            mission: The mission's state; only in flight to a stop are stops handed over.
            stops: The stops ahead, in the order flown.
            state: The vehicle's state; None if it has never given one.
            now: Mission clock, nanoseconds.
            ongoing: What needs the mission's setpoints, as a clause; empty for nothing.
        """
        del command, mission, stops, state, now, ongoing
        return Answer(accepted=False, text="this installation hands no waypoints over")

    def take_back(self, reason: str, now: int) -> None:
        """Let the drone fly by setpoints again, if somebody else flies or is about to.

        Args:
            reason: Why, as the alert says it.
            now: Mission clock, nanoseconds.
        """

    def step(self, stops: Sequence[QueuedWaypoint], state: VehicleState, now: int) -> bool:
        """Follow how far the handover is; a plan that has changed on the way is taken back.

        Args:
            stops: The stops as they are queued.
            state: The vehicle's state.
            now: Mission clock, nanoseconds.

        Returns:
            Whether somebody else flies.
        """
        del stops, state, now
        return False

    def follow(self, state: VehicleState, now: int, elapsed: float) -> list[QueuedWaypoint]:
        """The stops that were reached since the last turn, in order.

        Args:
            state: The vehicle's state; one without a position reaches nothing.
            now: Mission clock, nanoseconds.
            elapsed: Time since the last turn, seconds.
        """
        del state, now, elapsed
        return []

    def situation(self, stop: QueuedWaypoint) -> tuple[MissionState, str]:
        """The state of a mission whose next `stop` somebody else serves, and its reason."""
        return MissionState.ENROUTE, f"flying to {stop.id}"


def make_handover(context: HandoverContext) -> Handover:
    """The handover of a mission: the first that an extension adds, or one of nothing."""
    kinds = [*added("handovers"), Handover]
    handover: Handover = kinds[0](context)
    return handover
