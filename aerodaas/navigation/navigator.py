"""Where to fly next: the queue of waypoints, its plans, and the velocity command of the moment."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from aerodaas.clock import NANOSECONDS
from aerodaas.data import Header
from aerodaas.geometry import GeodeticOrigin, Vector
from aerodaas.navigation.geofence import Geofence
from aerodaas.navigation.planner import Plan, Planner, PlanRequest
from aerodaas.navigation.queue import Stop, WaypointQueue
from aerodaas.schedulers.waypoint.base import Situation
from aerodaas.waypoints import VelocityCommand, Waypoint

__all__ = ["LiveCommand", "Navigator"]


@dataclass(frozen=True, slots=True)
class LiveCommand:
    """A velocity command that has arrived."""

    command: VelocityCommand
    expires: int
    """Mission clock, nanoseconds."""
    cause: Header | None = None


class Navigator:
    """The navigation of one drone; knows no states, only what is queued and what is fresh."""

    def __init__(
        self,
        planner: Planner,
        fence: Geofence,
        *,
        home: Vector,
        max_range: float,
        origin: GeodeticOrigin | None,
        command_timeout: float,
        resume_after: float,
    ) -> None:
        """Plan with `planner` inside `fence`; `home` is the place of take-off, ENU metres."""
        self.queue = WaypointQueue()
        self.command: LiveCommand | None = None
        self.fault = ""
        """What the scheduler did wrong last."""
        self._planner = planner
        self._fence = fence
        self._home = home
        self._max_range = max_range
        self._origin = origin
        self._command_timeout = command_timeout
        self._resume_after = round(resume_after * NANOSECONDS)
        self._unplanned: set[int] = set()
        self._unanswered: PlanRequest | None = None

    def admit(
        self, waypoints: Iterable[Waypoint], now: float, deadline: float | None, source: str
    ) -> tuple[list[Waypoint], dict[str, str]]:
        """Resolve waypoints to local ENU; returns those that can be flown, and why others can't.

        `now` and `deadline` are seconds of mission time; raises nothing.
        """
        taken: list[Waypoint] = []
        refused: dict[str, str] = {}
        for asked in waypoints:
            try:
                waypoint = asked.resolve(self._home, self._origin)
            except ValueError as error:
                refused[asked.id] = str(error)
                continue
            limits = [limit for limit in (waypoint.deadline, deadline) if limit is not None]
            waypoint = replace(waypoint, deadline=min(limits, default=None))
            objection = self._objection(waypoint, now, source)
            if objection:
                refused[asked.id] = f"waypoint {asked.id!r}: {objection}"
            else:
                taken.append(waypoint)
        return taken, refused

    def _objection(self, waypoint: Waypoint, now: float, source: str) -> str:
        distance = float(((waypoint.position - self._home) ** 2).sum() ** 0.5)
        if distance > self._max_range:
            return f"{distance:.0f} m away is beyond the range of {self._max_range:g} m"
        if waypoint.deadline is not None and waypoint.deadline <= now:
            return f"its deadline of {waypoint.deadline:g} s is past, it is {now:.1f} s now"
        known = self.queue.find(waypoint.id)
        if known is not None and (not source or known.source != source):
            return "a waypoint of this id is already queued; use another id"
        return self._fence.objection(waypoint.position)

    def add(
        self,
        waypoints: list[Waypoint],
        *,
        group: str | None = None,
        index: int | None = None,
        source: str = "",
        cause: Header | None = None,
    ) -> None:
        """Queue admitted waypoints and have a plan made; raises InvalidWaypointError."""
        self.queue.add(waypoints, group=group, index=index, source=source, cause=cause)
        if index is None:
            self._unplanned |= {waypoint.priority for waypoint in waypoints}

    def obey(self, command: VelocityCommand, now: int, cause: Header | None) -> None:
        """Take a velocity command, unless a more urgent one is fresh."""
        present = self.command
        if present and now < present.expires and present.command.priority < command.priority:
            return
        valid_for = round(min(command.valid_for, self._command_timeout) * NANOSECONDS)
        self.command = LiveCommand(command, now + valid_for, cause)

    def replan(self) -> None:
        """Have everything that is queued planned anew: another scheduler plans from now on."""
        self._unanswered = None
        self._unplanned |= {stop.waypoint.priority for stop in self.queue}

    def clear(self) -> list[str]:
        """Forget everything that is queued, interrupted or commanded; returns the ids."""
        self.command = None
        self._unanswered = None
        self._unplanned.clear()
        return self.queue.clear()

    def finish(self, stop: Stop) -> None:
        """Take a stop out that was visited."""
        self.queue.remove(stop.id)
        if self._planner.replans_on_arrival:
            self._unplanned.add(stop.waypoint.priority)

    def served(self, now: int) -> Stop | LiveCommand | None:
        """Say what to fly by at `now`: the most urgent of stop and command, a stop in a tie.

        A command keeps its turn for a while after it has expired, so that a gap in the stream does
        not send the drone back to its plan.
        """
        stop, live = self.queue.head, self.command
        if live is not None and now >= live.expires + self._resume_after:
            live = None
        if stop is None or (live is not None and live.command.priority < stop.waypoint.priority):
            return live
        return stop

    @property
    def waits_for_plan(self) -> bool:
        """Whether a plan for the list being served has been asked for and not come."""
        return self._unanswered is not None and self._unanswered.level == self.queue.level

    def plan(self, situation: Situation) -> list[str] | None:
        """Ask for a plan where one is due and take one that has come.

        Returns the ids that the plan gives up, or None where no plan has come.
        """
        level = self.queue.level
        if level in self._unplanned:
            self._unplanned.remove(level)
            stops = self.queue.movable()
            if stops:
                request = PlanRequest(
                    self.queue.epoch,
                    level,
                    tuple(stop.waypoint for stop in stops),
                    replace(situation, ordered=_groups(stops)),
                )
                self._unanswered = request
                self._planner.submit(request)
        plan = self._planner.poll()
        return None if plan is None else self._take(plan)

    def _take(self, plan: Plan) -> list[str]:
        request = plan.request
        if request is self._unanswered:
            self._unanswered = None
        if request.epoch != self.queue.epoch:
            return []
        self.fault = plan.fault
        asked = [waypoint.id for waypoint in request.pending]
        return self.queue.reorder(request.level, asked, [waypoint.id for waypoint in plan.order])


def _groups(stops: list[Stop]) -> tuple[tuple[str, ...], ...]:
    groups: dict[str, list[str]] = {}
    for stop in stops:
        if stop.group is not None:
            groups.setdefault(stop.group, []).append(stop.id)
    return tuple(tuple(ids) for ids in groups.values() if len(ids) > 1)
