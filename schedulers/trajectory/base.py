"""The plug-in protocol of trajectory schedulers, and the handle that applications hold.

A user's scheduler is one method::

    class Farthest(TrajectoryScheduler):
        def plan(self, pending, situation):
            start = situation.position
            return sorted(pending, key=lambda w: -np.linalg.norm(w.position - start))
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from aerodaas.dataflow.given_settings import GivenSettings
from aerodaas.dataflow.graph import AeroStreamData, application_line
from aerodaas.dataflow.interfaces import IAeroData, IEnvironment, INavigate, IRobot
from aerodaas.dataflow.names import PaperNames
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.geometry.energy import EnergyModel
from aerodaas.geometry.frames import Vector
from aerodaas.messages.serialization.records import fast_pickle
from aerodaas.messages.waypoints import NavigationType, SchedulingType, Waypoint

__all__ = ["NavigationEntry", "NavigationSink", "PlanningContext", "TrajectoryScheduler"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class PlanningContext:
    """Input of a trajectory scheduler beside the waypoints."""

    now: float
    """Seconds of mission time."""
    position: Vector
    """Where the drone is, ENU metres."""
    home: Vector
    """Where it took off, ENU metres."""
    battery: float = 1.0
    """Charge left, 0 to 1."""
    speed: float = 1.0
    """Cruise speed, m/s."""
    ordered: tuple[tuple[str, ...], ...] = ()
    """Ids that must be visited in this order, for each ordered group of two or more."""
    energy: EnergyModel | None = None
    """Charge that flying takes; None if unknown."""
    reserve: float = 0.0
    """Charge that must be left on arrival at home."""


@dataclass(frozen=True, slots=True)
class NavigationEntry:
    """One `add_navigation` or `clear_navigation` as the application wrote it."""

    navigation: AeroNavigation
    index: int | None = None
    deadline: float | None = None
    clear_first: bool = False
    """The queue is emptied when this navigation's stream first yields."""
    robot: str | None = None
    """Id of the robot that it is meant for; None for the only one that flies."""
    line: str = ""
    """Where the application wrote it."""


@runtime_checkable
class NavigationSink(Protocol):
    """An environment whose mission may be running."""

    def navigation_added(self, entry: NavigationEntry) -> bool:
        """Take navigation in flight; False before the mission starts."""
        ...


class TrajectoryScheduler(GivenSettings, PaperNames, INavigate):
    """Orders waypoints; subclasses implement `plan`, which must be pure.

    `plan` is called beside the setpoint loop each time the queue changes and, if
    `replans_on_arrival`, after each arrival. It gets the waypoints of one priority at a time. The
    queue keeps ordered groups in their order whatever the plan says, so that a scheduler may
    ignore `situation.ordered`.
    """

    replans_on_arrival: bool = False
    isolated: bool = True
    """Plan in a process of its own, which may take long, hang or die; False for a scheduler that
    surely answers within some milliseconds."""

    def __init__(self, environment: IEnvironment | None = None) -> None:
        """Belong to `environment`, whose graph records the navigation."""
        self._environment = environment
        self.entries: list[NavigationEntry] = []
        self._cleared: set[str | None] = set()
        """Robots, None for the only one, whose next stream empties the queue."""

    @abstractmethod
    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:
        """Order `pending`, the next one first.

        Args:
            pending: Waypoints that may be reordered, in local ENU.
            situation: Where the drone is, its charge and its speed.

        Returns:
            The order; a waypoint left out of it is given up and reported as such.
        """

    def generate_navigation(self, data: IAeroData[Any]) -> AeroNavigation:
        """Turn waypoints or a stream of navigation into navigation that this scheduler orders."""
        if isinstance(data, AeroNavigation):
            return data
        if isinstance(data, AeroStreamData):
            return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, data)
        return AeroNavigation(
            NavigationType.DISTANCE_DRIVEN, data.get_data(), SchedulingType.UNORDERED
        )

    def add_navigation(
        self,
        data: IAeroData[Any],
        index: int | None = None,
        *,
        priority: int | None = None,
        deadline: float | None = None,
        robot: IRobot | str | None = None,
    ) -> None:
        """Add waypoints or a stream of navigation to a robot's queue, before or in the mission.

        Args:
            data: The waypoints, or a stream of navigation.
            index: Number of stops that they follow, and stay there; None for the end, to be
                planned.
            priority: Priority of all; None for the waypoints' own.
            deadline: Mission time by which all are to be reached, seconds; None for their own.
            robot: The robot or its id; may be left out where only one flies.

        Raises:
            GraphError: If no robot is named where several fly.
        """
        navigation = self.generate_navigation(data)
        if priority is not None:
            navigation = AeroNavigation(
                navigation.navigation_type,
                navigation.stream if navigation.stream is not None else navigation,
                navigation.scheduling_type,
                priority=priority,
            )
        named = _id_of(robot)
        cleared = {named, None} & self._cleared if navigation.stream is not None else set()
        line = application_line()
        self._enter(NavigationEntry(navigation, index, deadline, bool(cleared), named, line))
        self._cleared -= cleared

    def clear_navigation(
        self, *, on: AeroStreamData[Any] | None = None, robot: IRobot | str | None = None
    ) -> None:
        """Empty the queue of a robot.

        Before the mission, this is the paper's "on detection, reset the queue": what was added so
        far is forgotten, and the first item of the stream that is added next empties the queue of
        what `navigate()` was given, which is flown until then.

        Args:
            on: The stream whose first item empties the queue; None empties it now.
            robot: The robot or its id; may be left out where only one flies.

        Raises:
            GraphError: If no robot is named where several fly.
        """
        named, line = _id_of(robot), application_line()
        if on is not None:
            navigation = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, on)
            self._enter(NavigationEntry(navigation, clear_first=True, robot=named, line=line))
        elif not self._record_entry(
            NavigationEntry(AeroNavigation(), clear_first=True, robot=named, line=line)
        ):
            kept = [entry for entry in self.entries if named not in {None, entry.robot}]
            self.entries[:] = kept
            self._cleared.add(named)

    def _enter(self, entry: NavigationEntry) -> None:
        if not self._record_entry(entry):
            self.entries.append(entry)

    def _record_entry(self, entry: NavigationEntry) -> bool:
        sink: object = self._environment
        return isinstance(sink, NavigationSink) and sink.navigation_added(entry)

    def __getstate__(self) -> dict[str, Any]:
        """Leave the application's side behind when sent to the drone's actor."""
        kept = {name: value for name, value in self.__dict__.items() if name != "_given"}
        return {**kept, "_environment": None, "entries": []}


def _id_of(robot: IRobot | str | None) -> str | None:
    return robot if robot is None or isinstance(robot, str) else str(getattr(robot, "robot_id", ""))
