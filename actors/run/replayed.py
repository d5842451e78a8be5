"""What missions and analyses are told in a replay: the same, at the same mission times."""

from __future__ import annotations

import heapq
from collections import defaultdict, deque
from collections.abc import Iterator, Sequence
from typing import Any

from aerodaas.actors.session import Session
from aerodaas.config.plugins import load_plugin
from aerodaas.mission.planner import InlinePlanner, Plan, Planner, PlanRequest, SerialPlanner, solve
from aerodaas.schedulers.trajectory.base import TrajectoryScheduler
from aerodaas.types.clock import NANOSECONDS
from aerodaas.types.data import Header
from aerodaas.types.status import Message, ReceivedMessage
from aerodaas.types.vehicle import PlayedVehicle, VehicleState

__all__ = ["RecordedWork", "ReplayedArrivals", "WatchedPlanner", "as_planned"]

_LONGEST_PLANNING = 10 * NANOSECONDS
"""Mission time within which a recorded plan is taken for the answer to a request."""


class ReplayedArrivals:
    """Holds what came by stream until the mission time at which it counts.

    That is when it came; in a replay, when it came in the recorded flight, if it did.
    """

    def __init__(self, heard: Sequence[ReceivedMessage], commands: Sequence[str]) -> None:
        """`heard` is what a recorded flight heard, in order, with `commands` as its streams."""
        self._known: dict[tuple[str, str, int], list[tuple[int, int]]] = defaultdict(list)
        self._commands: dict[str, list[tuple[int, int]]] = defaultdict(list)
        for number, one in enumerate(heard):
            when = one.at, number
            self._known[one.stream, one.source, one.stamp].append(when)
            if one.stream in commands:
                self._commands[one.stream].append(when)
        self._waiting: list[tuple[int, int, int, Message[Any]]] = []
        self._used: set[tuple[int, int]] = set()
        self._late = len(heard)
        self._added = 0

    def add(self, message: Message[Any], now: int) -> None:
        """Take a message that came at mission time `now`."""
        at, number = self._recorded(message) or (now, self._late)
        self._added += 1
        heapq.heappush(self._waiting, (at, number, self._added, message))

    def before(self, now: int) -> Iterator[tuple[Message[Any], int]]:
        """What counts before mission time `now`, in order, each with its own time."""
        while self._waiting and self._waiting[0][0] < now:
            at, _, _, message = heapq.heappop(self._waiting)
            yield message, at

    def _recorded(self, message: Message[Any]) -> tuple[int, int] | None:
        header = message.header
        places = (
            self._known.get((message.stream, header.source, header.stamp)),
            # A camera says that it has ended when it is asked the next time: not a recorded one.
            self._commands.get(message.stream),
        )
        for when in (when for place in places if place for when in place):
            if when not in self._used:
                self._used.add(when)
                return when
        return None


class WatchedPlanner:
    """Passes everything on to a planner, and tells whether it answered in this turn."""

    def __init__(self, planner: Planner) -> None:
        """Watch `planner`."""
        self.planner = planner
        """May be replaced in flight."""
        self.answered = False

    def turn(self, now: int) -> None:
        """A turn begins at mission time `now`."""
        self.answered = False
        if isinstance(self.planner, _RecordedPlanner):
            self.planner.now = now

    @property
    def replans_on_arrival(self) -> bool:
        """Whether the scheduler wants to be asked again after each arrival."""
        return self.planner.replans_on_arrival

    def submit(self, request: PlanRequest) -> None:
        """Have a plan made."""
        self.planner.submit(request)

    def poll(self) -> Plan | None:
        """Return a plan that is ready."""
        plan = self.planner.poll()
        self.answered = self.answered or plan is not None
        return plan


def as_planned(scheduler: TrajectoryScheduler, turns: Sequence[int]) -> Planner:
    """A planner that answers at once, or when it did in a recorded flight."""
    return _RecordedPlanner(scheduler, turns) if turns else InlinePlanner(scheduler)


class _RecordedPlanner(SerialPlanner):
    """Plans on the spot and keeps each plan back until the turn at which one had come."""

    def __init__(self, scheduler: TrajectoryScheduler, turns: Sequence[int]) -> None:
        super().__init__(scheduler)
        self.now = 0
        self._turns = deque(turns)
        self._made: tuple[int, Plan] | None = None

    def poll(self) -> Plan | None:
        """Return the plan once it is due, and begin with the request that waits."""
        if self._made is None or self._made[0] > self.now:
            return None
        _, plan = self._made
        self._made = None
        self._next()
        return plan

    @property
    def _busy(self) -> bool:
        return self._made is not None

    def _begin(self, request: PlanRequest) -> None:
        while self._turns and self._turns[0] < self.now:
            self._turns.popleft()
        known = self._turns and self._turns[0] - self.now <= _LONGEST_PLANNING
        due = self._turns.popleft() if known else self.now
        self._made = due, solve(self._scheduler, request)


class RecordedWork:
    """What an analysis worked on in a recorded flight, and by which states of its vehicle.

    In a flight that is no replay, everything is worked on, and no state is recorded.
    """

    def __init__(self, session: Session, stream: str, robot: str) -> None:
        """Of the analysis that publishes `stream`, from the data of `robot`."""
        self._session = session
        self._work = session.replay_timeline.work.get(stream)
        self._robot = robot
        self._vehicle: PlayedVehicle | None = None
        self._stamp: int | None = None

    def includes(self, header: Header) -> bool:
        """Tell whether this measurement was worked on; a live analysis leaves out what it must."""
        known = self._known(header)
        return known is None or header.stamp in known

    def turn_to(self, header: Header) -> None:
        """Work on this measurement begins."""
        self._stamp = (self._known(header) or {}).get(header.stamp)

    def vehicle(self) -> VehicleState | None:
        """The state by which the measurement was worked on; None where none is recorded."""
        if self._stamp is None:
            return None
        if self._vehicle is None:
            self._vehicle = self._play()
        self._vehicle.advance_to(self._stamp)
        return self._vehicle.read()

    def _known(self, header: Header) -> dict[int, int | None] | None:
        return None if self._work is None else self._work.get(header.source)

    def _play(self) -> PlayedVehicle:
        environment = self._session.environment
        config = next(one for one in environment.robots if one.id == self._robot)
        vehicle: PlayedVehicle = load_plugin("drivers", config.driver)(config, environment)
        vehicle.connect()
        return vehicle
