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
from typing import Any

from aerodaas.geometry import Vector
from aerodaas.graph import AeroStreamData
from aerodaas.interfaces import IAeroData, IEnvironment, INavigate
from aerodaas.names import PaperNames
from aerodaas.waypoints import AeroNavigation, NavigationType, SchedulingType, Waypoint

__all__ = ["NavigationEntry", "Situation", "TrajectoryScheduler"]


@dataclass(frozen=True, slots=True)
class Situation:
    """What a trajectory scheduler may know when it plans."""

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


@dataclass(frozen=True, slots=True)
class NavigationEntry:
    """One `add_navigation` or `clear_navigation` as the application wrote it."""

    navigation: AeroNavigation
    index: int | None = None
    deadline: float | None = None
    clear_first: bool = False
    """The queue is emptied when this navigation's stream first yields."""


class TrajectoryScheduler(PaperNames, INavigate):
    """Orders waypoints; subclasses implement `plan`, which must be pure and fast.

    `plan` is called in the drone's actor each time the queue changes and, if
    `replans_on_arrival`, after each arrival.
    """

    replans_on_arrival: bool = False

    def __init__(self, environment: IEnvironment | None = None) -> None:
        """Belong to `environment`, whose graph records the navigation."""
        self._environment = environment
        self.entries: list[NavigationEntry] = []

    @abstractmethod
    def plan(self, pending: Sequence[Waypoint], situation: Situation) -> Sequence[Waypoint]:
        """Order `pending` (local ENU waypoints that may be reordered), the next one first.

        A waypoint left out of the answer is given up and reported as such.
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
    ) -> None:
        """Add waypoints or a stream of navigation to the queue, before or during the mission."""
        navigation = self.generate_navigation(data)
        if priority is not None:
            navigation = AeroNavigation(
                navigation.navigation_type,
                navigation.stream if navigation.stream is not None else navigation,
                navigation.scheduling_type,
                priority=priority,
            )
        self.entries.append(NavigationEntry(navigation, index, deadline))

    def clear_navigation(self, *, on: AeroStreamData[Any] | None = None) -> None:
        """Empty the queue: now, or when the stream `on` first yields something."""
        if on is None:
            self.entries.clear()
            return
        navigation = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, on)
        self.entries.append(NavigationEntry(navigation, clear_first=True))

    def __getstate__(self) -> dict[str, Any]:
        """Leave the environment behind when sent to the drone's actor."""
        return {**self.__dict__, "_environment": None}
