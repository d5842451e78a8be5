"""Executors: what performs the actions of waypoints in one mission, and how extensions add more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

from aerodaas.config.extensions import added
from aerodaas.config.sections.robot import RobotConfig
from aerodaas.errors import failure_line
from aerodaas.geometry.frames import Vector
from aerodaas.messages.mission import MissionState
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import Answer, Command
from aerodaas.mission.log import MissionLog
from aerodaas.mission.navigation.queue import QueuedWaypoint

__all__ = ["ActionExecutor", "ActionRunner", "Course", "action_objection", "added_executors"]

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Course:
    """Where a drone flies next on the way to a stop."""

    place: Vector
    """The stop, a corner before it, or a place on a line towards it; ENU metres."""
    heading: float | None = None
    """Of the nose, radians counter-clockwise from east; None as the drone flies."""
    brakes: bool = True
    """Whether the drone flies towards the place so that it could stop there."""


class ActionExecutor:
    """Performs some kinds of actions in one mission, which calls it once a turn.

    Every method returns at once.

    One of an extension (`Extension.action_executors`) is constructed with the vehicle, the robot's
    section of the environment file and the mission's log, for its alerts. The vehicle may be any
    object: an executor asks whether it is one that it can use.
    """

    order: ClassVar[int] = 3
    """As `Action.order`: an executor of a lower number comes first."""

    @classmethod
    def objection(cls, waypoint: Waypoint, robot: RobotConfig) -> str:
        """Why an action of a waypoint is not possible, before the flight and in it.

        Args:
            waypoint: The waypoint.
            robot: The robot that is to fly there.

        Returns:
            One clause; empty if all are.
        """
        del waypoint, robot
        return ""

    def handle(self, command: Command, state: MissionState, now: int) -> Answer | None:
        """Execute a command that concerns the executor's equipment.

        Args:
            command: The command.
            state: The mission's state.
            now: Mission clock, nanoseconds.

        Returns:
            The answer; None for a command of others.
        """
        del command, state, now
        return None

    def poll(self, now: int) -> None:
        """Process what the vehicle has said, once a turn; `now` is the mission clock, ns."""

    def attend(self, stop: QueuedWaypoint, odometry: Odometry, now: int) -> bool:
        """Do what is due for a stop, to which the drone flies or at which it is.

        Args:
            stop: The stop, whose `arrived` tells whether the drone is there.
            odometry: Where the drone is.
            now: Mission clock, nanoseconds.

        Returns:
            Whether the drone has to stay there for it.
        """
        del stop, odometry, now
        return False

    def steer(self, course: Course, odometry: Odometry, now: int) -> Course:
        """Return where the drone flies for the sake of the stop's actions.

        Args:
            course: Course without them.
            odometry: Where the drone is, how it moves and where it faces.
            now: Mission clock, nanoseconds.
        """
        del odometry, now
        return course

    def stops_at(self, stop: QueuedWaypoint, following: QueuedWaypoint, radius: float) -> bool:
        """Whether the drone has to stop at the end of a leg, besides for actions that `stops`.

        Args:
            stop: The stop where the leg ends.
            following: The stop after it.
            radius: Distance from the leg's end at which the drone turns, metres.
        """
        del stop, following, radius
        return False

    def ongoing(self) -> str:
        """Return the action that goes on between waypoints, as a clause; empty for none."""
        return ""

    def interruption(self) -> tuple[MissionState, str] | None:
        """PAUSED or RETURNING, with the reason, after a failure at a stop; returned once."""
        return None

    def ending(self) -> tuple[MissionState, str] | None:
        """LANDING or ABORTED, with the reason, as long as the flight cannot go on."""
        return None

    def on_state(self, state: MissionState, now: int) -> None:
        """Do what is due in a state of the mission; in its last one, end what goes on.

        Args:
            state: The mission's state.
            now: Mission clock, nanoseconds.
        """


def action_objection(waypoint: Waypoint, robot: RobotConfig) -> str:
    """Why an action of a waypoint is not possible; empty if all are.

    Args:
        waypoint: The waypoint.
        robot: The robot that is to fly there.
    """
    if not waypoint.actions:
        return ""
    return _first(kind.objection(waypoint, robot) for kind in added("action_executors")) or ""


def _first(found: Iterable[T | None]) -> T | None:
    return next(filter(None, found), None)


def added_executors(vehicle: object, robot: RobotConfig, log: MissionLog) -> list[ActionExecutor]:
    """Executors of one mission that extensions add, in their order.

    Args:
        vehicle: The vehicle.
        robot: Its section of the environment file.
        log: The mission's log.
    """
    kinds = sorted(added("action_executors"), key=lambda kind: kind.order)
    return [executor(vehicle, robot, log) for executor in kinds]


class ActionRunner(ActionExecutor):
    """All executors of one mission, in order: one begins when those before it are done."""

    def __init__(self, executors: Sequence[ActionExecutor], log: MissionLog) -> None:
        """Call `executors`; what one raises is an alert in `log`, and its action is over."""
        self._executors = executors
        self._log = log
        self._now = 0

    def handle(self, command: Command, state: MissionState, now: int) -> Answer | None:
        """The first answer; None if no executor knows the command."""
        return _first(executor.handle(command, state, now) for executor in self._executors)

    def poll(self, now: int) -> None:
        """Poll each."""
        self._now = now
        for executor in self._executors:
            self._call(executor.poll, now)

    def attend(self, stop: QueuedWaypoint, odometry: Odometry, now: int) -> bool:
        """Attend to a stop by each, until the drone has to stay for one."""
        return any(self._call(one.attend, stop, odometry, now) for one in self._executors)

    def steer(self, course: Course, odometry: Odometry, now: int) -> Course:
        """Have each change the course."""
        for executor in self._executors:
            course = self._call(executor.steer, course, odometry, now) or course
        return course

    def stops_at(self, stop: QueuedWaypoint, following: QueuedWaypoint, radius: float) -> bool:
        """Whether the drone has to stop for one."""
        return any(self._call(one.stops_at, stop, following, radius) for one in self._executors)

    def ongoing(self) -> str:
        """The first that goes on; empty for none."""
        return _first(self._call(executor.ongoing) for executor in self._executors) or ""

    def interruption(self) -> tuple[MissionState, str] | None:
        """The first."""
        return _first(self._call(executor.interruption) for executor in self._executors)

    def ending(self) -> tuple[MissionState, str] | None:
        """The first."""
        return _first(self._call(executor.ending) for executor in self._executors)

    def on_state(self, state: MissionState, now: int) -> None:
        """Inform each."""
        for executor in self._executors:
            self._call(executor.on_state, state, now)

    def _call(self, method: Callable[..., Any], *arguments: Any) -> Any:  # noqa: ANN401 - any of its
        """Call a method of an executor; None where it raises."""
        try:
            return method(*arguments)
        except Exception as error:  # noqa: BLE001 - an extension must not end a flight
            text = f"{method.__qualname__}: {failure_line(error)}"
            self._log.alert(self._now, "action", text)
            return None
